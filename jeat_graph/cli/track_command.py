"""`jeat-graph track`: detections in, a run directory out."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from jeat_graph.cli.options import (
    add_config,
    add_formats,
    add_image,
    add_output_rate,
    add_reading,
    add_smoother,
    extra_formats,
    overrides,
)
from jeat_graph.cli.terminal import one_line

HELP = "track the vehicles in files of detections and write a run directory"


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
    add_config(parser)
    add_image(parser)
    add_smoother(parser)
    add_formats(parser)
    add_output_rate(parser, "frames per second of output that counts frames", "--frame-rate")
    add_reading(parser)
    add(
        "--resume",
        action="store_true",
        help="go on where a run of the same command into the same folder was broken off",
    )
    add(
        "--frames",
        metavar="VIDEO|DIR",
        help="pictures that the detections were made from: tell the picture's size and the frame rate",
    )


def run(args: argparse.Namespace) -> int:
    """Read, check, track, and write the run directory."""
    from jeat_graph.runs.run_options import RunOptions
    from jeat_graph.runs.track_files import TrackRequest, track_files

    request = TrackRequest(
        detections=tuple(str(item) for item in args.detections),
        out=args.out,
        config=args.config,
        overrides=tuple(overrides(args)),
        rate_hz=args.rate,
        input_format=args.input_format,
        score_scale=args.score_scale,
        images=args.images,
        time_unit=args.time_unit,
        frames=args.frames,
        options=RunOptions(
            formats=extra_formats(args),
            frame_rate_hz=args.output_rate if args.output_rate is not None else args.rate,
            progress=sys.stderr.isatty(),
            diagnostics=args.diagnostics,
            resume=args.resume,
        ),
    )
    counts = track_files(request, _warn, _say).counts
    print(f"{counts['scans']} scans, {counts['detections']} detections: {counts['tracks_reported']} tracks")
    print(f"wrote {Path(args.out)}")
    return 0


def _say(text: str) -> None:
    print(f"jeat-graph track: {text}", file=sys.stderr)


def _warn(text: str) -> None:
    print(f"jeat-graph track: warning: {one_line(text)}", file=sys.stderr)
