"""What the help of the commands shows beside their arguments: groups of commands, and one example of each."""

from __future__ import annotations

import argparse

#: Titles of the groups, each above its first command in `jeat-graph --help`.
GROUPS = {
    "demo": "try it",
    "track": "track",
    "eval": "evaluate and explain",
    "render": "show and export",
    "draw": "count, and measure on the road",
    "events": "raw recordings and detectors",
    "calibrate": "calibrate sensors",
}
EXAMPLES = {
    "demo": "jeat-graph demo --out demo",
    "simulate": "jeat-graph simulate night-nolight --duration 12 --seed 1 --out sim",
    "events": "jeat-graph events info night.raw",
    "detect": "jeat-graph detect --frames night.mp4 --events night.raw --out detections.csv",
    "detectors": "jeat-graph detectors --fetch yolox-s",
    "train": "jeat-graph train frames train-day --out frames.onnx",
    "teach": "jeat-graph teach run --events night.raw --detector sehn --out mine.onnx",
    "track": "jeat-graph track detections.csv --out run",
    "stream": "jeat-graph stream --format csv < scans.jsonl > tracks.csv",
    "serve": "jeat-graph serve --check gantry7.yaml",
    "batch": "jeat-graph batch manifest.csv --out week",
    "eval": "jeat-graph eval run bytetrack.txt --gt gt.csv",
    "compare": "jeat-graph compare run --gt gt.csv --out comparison",
    "count": "jeat-graph count run --line north=200,500,900,520 --interval 900 --out counts.csv",
    "recount": "jeat-graph recount crossings.csv --video street.mp4 --line north --lines marks.yaml "
    "--out recount.html",
    "explain": "jeat-graph explain run --track 7",
    "draw": "jeat-graph draw run --frames street.mp4",
    "frame": "jeat-graph frame street.mp4 --grid --out street.png",
    "export": "jeat-graph export run --to coco --out run.json",
    "view": "jeat-graph view run",
    "render": "jeat-graph render run --frames night.mp4 --out run.mp4",
    "report": "jeat-graph report run --out run.html",
    "calibrate": "jeat-graph calibrate a.csv b.csv --gt a_gt.csv b_gt.csv --out mine.yaml",
    "register": "jeat-graph register rgb.csv evt.csv --out rig.yaml",
    "camera": "jeat-graph camera calibrate --run run --lengths lengths.csv --out camera.yaml",
    "road": "jeat-graph road run --camera camera.yaml --out speeds",
    "handover": "jeat-graph handover A=speeds-a B=speeds-b --distance A-B=500±5 --out through",
    "conflicts": "jeat-graph conflicts speeds --camera camera.yaml --out near-misses",
}


class GroupedFormatter(argparse.HelpFormatter):
    """Write the title of a group of commands above the first one."""

    def _format_action(self, action: argparse.Action) -> str:
        text = super()._format_action(action)
        if isinstance(action, argparse._SubParsersAction) or action.option_strings:
            return text
        title = GROUPS.get(str(action.metavar))
        return text if title is None else f"\n {title}:\n{text}"
