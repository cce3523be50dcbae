"""`jeat-graph simulate`: detections and truth of the built-in highway."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

HELP = "simulate a highway seen by an RGB and an event camera: detections and truth"
_DENSITIES = ("sparse", "normal", "dense")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument(
        "scenario", metavar="SCENARIO", help="a name (day, night, night-nolight, …) or a YAML file"
    )
    parser.add_argument("--out", required=True, metavar="DIR", help="folder to write into")
    parser.add_argument("--duration", type=float, default=30.0, metavar="S", help="length (default 30)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed (default 0)")
    parser.add_argument("--density", choices=_DENSITIES, help="traffic density (default: the scenario's)")
    parser.add_argument(
        "--sensors",
        choices=("detections",),
        default="detections",
        help="what to simulate (default detections)",
    )


def run(args: argparse.Namespace) -> int:
    """Simulate, write the files and print what was written."""
    import numpy as np
    import yaml
    from tqdm import tqdm

    from jeat_graph.io.atomic import open_atomic
    from jeat_graph.io.detections_io import write_detections
    from jeat_graph.io.hashing import sha256_of
    from jeat_graph.io.truth_io import write_truth
    from jeat_graph.sehn.scenario import load_scenario, scenario_to_yaml
    from jeat_graph.sehn.simulate import record
    from jeat_graph.version import __version__

    scenario = load_scenario(args.scenario, args.density)
    out = Path(args.out)
    with tqdm(total=3, desc="simulate", disable=not sys.stderr.isatty(), leave=False) as bar:
        recording = record(scenario, args.seed, args.duration)
        bar.update()
        detections, truth = recording.detections, recording.truth
        write_detections(detections, out / "detections.csv")
        bar.update()
        write_truth(truth, out / "gt.csv")
        bar.update()
    with open_atomic(out / "scenario.yaml") as file:
        file.write(scenario_to_yaml(scenario))
    with open_atomic(out / "camera.yaml") as file:
        file.write(yaml.safe_dump(recording.scene.camera.to_dict(), sort_keys=False))

    boxes = np.diff(detections.scan_start)
    sensors = {
        name: {
            "scans": int((detections.scan_sensor == k).sum()),
            "detections": int(boxes[detections.scan_sensor == k].sum()),
        }
        for k, name in enumerate(detections.sensors)
    }
    names = ("detections.csv", "gt.csv", "scenario.yaml", "camera.yaml")
    manifest: dict[str, Any] = {
        "version": __version__,
        "scenario": str(args.scenario),
        "seed": args.seed,
        "duration_s": args.duration,
        "density": scenario.traffic.density,
        "sensors": sensors,
        "truth": {
            "frames": len(truth.frame_times()),
            "boxes": len(truth),
            "ignored": int(truth.ignore.sum()),
            "objects": len(np.unique(truth.object_id)),
        },
        "sha256": {name: sha256_of(out / name) for name in names},
    }
    with open_atomic(out / "manifest.json") as file:
        file.write(json.dumps(manifest, indent=2) + "\n")
    for name, count in sensors.items():
        print(f"{name}: {count['detections']} boxes in {count['scans']} scans")
    print(f"truth: {manifest['truth']['objects']} vehicles in {manifest['truth']['frames']} frames")
    print(f"wrote {out}")
    return 0
