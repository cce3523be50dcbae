"""`jeat-graph export`: a run for other people's programs."""

from __future__ import annotations

import argparse
import sys

from jeat_graph.cli.options import add_output_rate, add_tables, tables_read
from jeat_graph.exporting.record import SOME_TAKE, ExportRequest
from jeat_graph.exporting.registry import exports, write_export

WRITES = ("out",)
HELP = (
    "write a run for other programs (CVAT, COCO, OTAnalytics, TUM, rerun), a road for SUMO, "
    "highD and maps, or a simulated set for RVT and DSEC-Detection"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument(
        "source",
        metavar="RUN|ROAD|SET",
        help="run directory or trajectory table; for road formats the output of `road`; for rvt, "
        "rvt-input and dsec-det the output of `simulate --sensors pictures`",
    )
    names = [one.name for one in exports()]
    parser.add_argument("--to", choices=names, required=True, help="target program or format")
    written = "; ".join(f"{one.name}: {one.writes.replace('`', '')}" for one in exports())
    parser.add_argument("--out", required=True, metavar="FILE", help=written.replace("%", "%%"))
    parser.add_argument(
        "--only", choices=("causal", "smoothed"), help="which table (default: smoothed, if it exists)"
    )
    parser.add_argument("--track", type=int, metavar="ID", help="the track, for tum")
    add_output_rate(
        parser,
        "frames per second of the video or of the road's frames (default: that of the run's "
        "input; roads: 25)",
        "--frames-per-second",
    )
    add_tables(parser)
    parser.add_argument(
        "--camera",
        metavar="CAMERA.yaml",
        help="calibrated camera with its place on the map, for sumo and geojson",
    )
    parser.add_argument("--video", metavar="NAME", help="file name of the video, for ottrk")
    parser.add_argument(
        "--start", type=float, metavar="S", help="start time of the video in seconds since 1970, for ottrk"
    )


def run(args: argparse.Namespace) -> int:
    """Export."""
    some = {name: getattr(args, name) for name in SOME_TAKE}
    summary = write_export(ExportRequest(args.source, args.out, args.to, **some, reading=tables_read(args)))
    print(f"wrote {args.out}{summary}", file=sys.stderr)
    return 0
