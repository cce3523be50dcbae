"""`jeat-graph road`: where on the road the vehicles were and how fast they drove, with intervals."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from jeat_graph.data.errors import DataError

HELP = "metres, km/h and lanes on the road, each with its uncertainty"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    add = parser.add_argument
    add("source", metavar="RUN|TABLE", help="run directory, trajectory table, or table of t, track_id, x, y")
    add("--camera", required=True, metavar="CAMERA.yaml", help="the calibrated camera")
    add(
        "--lines",
        metavar="LINES.yaml",
        help="lines: {name: [x1, y1, x2, y2]} px, lanes: {name: [left, right]} m",
    )
    add(
        "--contact",
        choices=("cuboid", "bottom", "center"),
        help="what of a vehicle is on the road (center for points)",
    )
    add(
        "--contact-height",
        nargs=2,
        type=float,
        metavar=("M", "SD"),
        help="height of the tracked point above the road and how well it is known (0.1 0.058)",
    )
    add("--out", required=True, metavar="DIR", help="where road.csv, speeds.csv and crossings.csv go")


def run(args: argparse.Namespace) -> int:
    """Fit the vehicles and write the tables."""
    from tqdm import tqdm

    from jeat_graph.road.camera_file import read_camera
    from jeat_graph.road.inputs import RoadMarks, read_marks
    from jeat_graph.road.lanes import LaneConfig
    from jeat_graph.road.motion_fit import MotionFitConfig
    from jeat_graph.road.points_road import follow_points, summarise
    from jeat_graph.road.results import write_result
    from jeat_graph.road.sources import contact_pixels
    from jeat_graph.road.speeds import ContactConfig

    out = Path(args.out)
    if out.exists() and not out.is_dir():
        raise DataError("is a file; --out must be a folder", out)
    camera = read_camera(args.camera)
    marks = RoadMarks({}, {}) if args.lines is None else read_marks(args.lines)
    points = contact_pixels(args.source, args.contact)
    contact = ContactConfig()
    if args.contact_height is not None:
        contact = ContactConfig(height_m=args.contact_height[0], height_sd_m=args.contact_height[1])
    with tqdm(total=len(points.tracks()), unit="vehicle", disable=not sys.stderr.isatty()) as bar:

        def advance(done: int, _total: int) -> None:
            bar.update(done - bar.n)

        vehicles = follow_points(points, camera, MotionFitConfig(), contact, advance)
    result = summarise(vehicles, camera, marks, contact, LaneConfig())
    write_result(result, out)
    left_out = len(points.tracks()) - len(vehicles)
    if left_out:
        print(
            f"jeat-graph road: {left_out} tracks too short, or not on the road, are left out", file=sys.stderr
        )
    print(
        f"{len(vehicles)} vehicles, {len(result.lanes.names)} lanes, {len(result.crossings)} crossings: {out}"
    )
    return 0
