"""`jeat-graph detect`: pictures and events in, a file of detections out."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jeat_graph.cli.detect_options import add_detecting, detect_request
from jeat_graph.cli.options import add_rate
from jeat_graph.cli.terminal import one_line
from jeat_graph.data.errors import DataError
from jeat_graph.data.progress import heard, ticking, write_line

if TYPE_CHECKING:
    from jeat_graph.data.detections import Detections
    from jeat_graph.detection.detecting import DetectRequest

HELP = "find vehicles in raw pictures and events and write a file of detections"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    add = parser.add_argument
    add("--frames", metavar="VIDEO|DIR|AEDAT4", help="a video, a folder of pictures, or an AEDAT4 file")
    add("--events", metavar="FILE", help="a file of events: RAW, DAT, AEDAT, HDF5, ROS bag")
    add_detecting(parser)
    add_rate(parser)
    add("--out", required=True, metavar="FILE", help="FILE.csv or FILE.parquet")


def run(args: argparse.Namespace) -> int:
    """Detect, and write the file."""
    from jeat_graph.io.atomic import check_writable
    from jeat_graph.io.detections_io import write_detections

    request = detect_request(args)
    out = Path(args.out)
    if out.suffix.lower() not in (".csv", ".parquet"):
        raise DataError("must end in .csv or .parquet", out)
    if any(Path(path).resolve() == out.resolve() for path in request.files):
        raise DataError("would be replaced by the result; choose another --out", out)
    check_writable(out)
    found = detect_with_bar(request, "detect")
    write_detections(found, out)
    boxes = np.diff(found.scan_start)
    for k, name in enumerate(found.sensors):
        of_sensor = found.scan_sensor == k
        print(f"{name}: {int(boxes[of_sensor].sum())} boxes in {int(of_sensor.sum())} scans")
    print(f"wrote {out}")
    return 0


def detect_with_bar(request: DetectRequest, command: str) -> Detections:
    """Detect, and show on a terminal how far it has come."""
    from tqdm import tqdm

    from jeat_graph.detection.detecting import detect_files

    def say(text: str) -> None:
        write_line(f"jeat-graph {command}: {one_line(text)}")

    hidden = not sys.stderr.isatty()
    if request.frames is not None:
        form = "{desc}: {percentage:3.0f}%|{bar}| [{elapsed}<{remaining}]"
        with (
            tqdm(total=1.0, desc="detect", bar_format=form, disable=hidden, leave=False) as bar,
            ticking(bar),
            heard(lambda share: bar.update(share - bar.n)),
        ):
            return detect_files(request, say)
    # How long a file of events lasts is known at its end only.
    form = "{desc}: {n:.1f} s of the recording [{elapsed}]"
    with tqdm(desc="detect", bar_format=form, disable=hidden, leave=False) as bar, ticking(bar):

        def on_time(t: float) -> None:
            bar.update(max(t - bar.n, 0.0))

        return detect_files(request, say, on_time)
