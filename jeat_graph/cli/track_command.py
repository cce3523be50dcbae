"""`jeat-graph track`: detections in, a run directory out."""

from __future__ import annotations

import argparse
import sys
import time
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
    from jeat_graph.config.reading import load_config
    from jeat_graph.io.detections_io import read_many, split_name
    from jeat_graph.runs.directory import RunDirectory
    from jeat_graph.runs.input_checks import check_detections
    from jeat_graph.runs.tracking_run import RunOptions, RunRecord, describe_inputs, write_run
    from jeat_graph.tracking.warm_up import notice_if_cold

    begin = time.perf_counter()
    overrides = list(args.overrides)
    if args.smoother is not None:
        overrides.append(f"smoother.engine={args.smoother}")
    config = load_config(args.config, overrides)
    files = [str(split_name(item)[1]) for item in args.detections]
    directory = RunDirectory(args.out, inputs=files)
    options = RunOptions(
        formats=tuple(dict.fromkeys(name for name in args.formats if name != "csv")),
        frame_rate_hz=args.frame_rate if args.frame_rate is not None else args.rate,
        progress=sys.stderr.isatty(),
        diagnostics=args.diagnostics,
    )
    reading = {
        "rate_hz": args.rate,
        "fmt": args.input_format,
        "score_scale": args.score_scale,
        "images": args.images,
    }
    detections = read_many(args.detections, **reading)
    record = RunRecord(
        source={
            "config_name": args.config,
            "overrides": overrides,
            "inputs": describe_inputs(files),
            "reading": {"detections": [str(item) for item in args.detections], **reading},
        },
        warnings=check_detections(detections, config, " + ".join(files)),
    )
    for warning in record.warnings:
        print(f"jeat-graph track: warning: {warning}", file=sys.stderr)
    record.timings["read_s"] = round(time.perf_counter() - begin, 4)
    notice_if_cold()
    with directory:
        write_run(detections, config, directory, record, options)
    counts = record.counts
    print(f"{detections.num_scans} scans, {len(detections)} detections: {counts['tracks_reported']} tracks")
    print(f"wrote {Path(args.out)}")
    return 0
