"""`jeat-graph track`: detections in, a run directory out."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from jeat_graph.config.argument_types import positive

HELP = "track the vehicles in files of detections and write a run directory"
INPUT_FORMATS = ("csv", "parquet", "motchallenge", "kitti", "prophesee", "coco")
ENGINES = ("fixed-lag", "full", "rts", "fixed-lag-rts", "none")
OUTPUT_FORMATS = ("csv", "parquet", "motchallenge", "kitti")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    add = parser.add_argument
    add(
        "detections",
        nargs="+",
        metavar="DETECTIONS",
        help="files of one scene, say one a sensor: CSV or Parquet with t, sensor, left, top, width, height, "
        "score; MOTChallenge det.txt; KITTI; Prophesee or DSEC .npy; COCO results; NAME=path names a sensor",
    )
    add(
        "--out",
        required=True,
        metavar="DIR",
        help="run directory; files of an earlier run there are replaced, other files left alone",
    )
    add("--config", default="default", metavar="NAME|FILE", help="preset or YAML file (default: default)")
    add(
        "--set",
        dest="overrides",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="change one setting, say image.width=1920; may be given many times",
    )
    add(
        "--smoother",
        choices=ENGINES,
        help="engine of smoothed.csv: fixed-lag (live, with a delay), full (whole tracks, fragments "
        "stitched), rts (the same, fast), fixed-lag-rts, none; default: as the configuration says",
    )
    add(
        "--format",
        dest="formats",
        nargs="+",
        action="extend",
        default=[],
        choices=OUTPUT_FORMATS,
        metavar="NAME",
        help="also write the tables as parquet, motchallenge, kitti (csv is always written)",
    )
    add(
        "--frame-rate",
        type=positive,
        metavar="HZ",
        help="frames per second of such output files",
    )
    add(
        "--diagnostics",
        action="store_true",
        help="also write diagnostics.csv: NIS and noise scale of every update, for the pages of `report`",
    )
    add("--rate", type=positive, metavar="HZ", help="frames per second of input files that count frames")
    add("--input-format", choices=INPUT_FORMATS, help="format of the input, if it is not recognised")
    add(
        "--score-scale",
        choices=("unit", "percent", "logistic"),
        default="unit",
        help="scores are in [0, 1] (unit), percent, or raw scores of any size (logistic)",
    )
    add("--images", metavar="FILE", help="COCO data set with the images and times of COCO results")


def run(args: argparse.Namespace) -> int:
    """Read, check, track, and write the run directory."""
    from jeat_graph.runs.track_files import TrackRequest, track_files
    from jeat_graph.runs.tracking_run import RunOptions

    overrides = list(args.overrides)
    if args.smoother is not None:
        overrides.append(f"smoother.engine={args.smoother}")
    request = TrackRequest(
        detections=tuple(str(item) for item in args.detections),
        out=args.out,
        config=args.config,
        overrides=tuple(overrides),
        rate_hz=args.rate,
        input_format=args.input_format,
        score_scale=args.score_scale,
        images=args.images,
        options=RunOptions(
            formats=tuple(dict.fromkeys(name for name in args.formats if name != "csv")),
            frame_rate_hz=args.frame_rate if args.frame_rate is not None else args.rate,
            progress=sys.stderr.isatty(),
            diagnostics=args.diagnostics,
        ),
    )
    counts = track_files(request, _warn).counts
    print(f"{counts['scans']} scans, {counts['detections']} detections: {counts['tracks_reported']} tracks")
    print(f"wrote {Path(args.out)}")
    return 0


def _warn(text: str) -> None:
    print(f"jeat-graph track: warning: {text}", file=sys.stderr)
