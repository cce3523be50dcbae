"""`jeat-graph road`: where on the road the vehicles were and how fast they drove, with intervals."""

from __future__ import annotations

import argparse
import math
import sys
from collections import Counter
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jeat_graph.cli.count_output import clock_s, later_s, with_clock
from jeat_graph.cli.options import add_counting, frames_read
from jeat_graph.cli.terminal import say
from jeat_graph.config.argument_types import positive
from jeat_graph.data.errors import DataError

if TYPE_CHECKING:
    from jeat_graph.road.results import RoadResult

WRITES_INTO = ("out",)
HELP = "compute positions (m), speeds (km/h) and lanes on the road, each with its uncertainty"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    add = parser.add_argument
    add(
        "source",
        metavar="RUN|TABLE",
        help="run directory, trajectory table, another tracker's result, or table of t, track_id, x, y",
    )
    add("--camera", required=True, metavar="CAMERA.yaml", help="the calibrated camera")
    add(
        "--lines",
        metavar="LINES.yaml",
        help="lines: {name: [x1, y1, x2, y2]} px, lanes: {name: [left, right]} m",
    )
    add(
        "--contact",
        choices=("cuboid", "bottom", "center"),
        help="which point of a vehicle is measured on the road (default: cuboid for boxes, center for "
        "points)",
    )
    add(
        "--contact-height",
        nargs=2,
        type=float,
        metavar=("M", "SD"),
        help="height of the tracked point above the road and its standard deviation (0.1 0.058)",
    )
    add(
        "--smoother",
        choices=("spline", "graph"),
        default="spline",
        help="solver that fits the boxes: the compiled one, or a factor graph in GTSAM (spline)",
    )
    add_counting(parser)
    add("--interval", type=positive, metavar="S", help="length of an interval of counts.csv (300)")
    add(
        "--begin",
        metavar="DATE",
        help="date and time of the recording's time 0, say --begin 2026-11-27T07:30:00: counts, crossings "
        "and headways are of that clock",
    )
    add(
        "--out",
        required=True,
        metavar="DIR",
        help="folder for road.csv, speeds.csv, crossings.csv, counts.csv, headways.csv and road.html",
    )


def run(args: argparse.Namespace) -> int:
    """Fit the vehicles and write the tables."""
    from jeat_graph.data.tables.reading import ReadingOptions
    from jeat_graph.io.files.outputs import check_folder
    from jeat_graph.io.tables.trajectories_io import read_trajectories
    from jeat_graph.road.box_rows import BoxConfig
    from jeat_graph.road.boxes_road import BOX_MOTION, follow_boxes
    from jeat_graph.road.camera_file import read_camera
    from jeat_graph.road.cuboid_fit import CuboidConfig
    from jeat_graph.road.inputs import RoadMarks, read_marks
    from jeat_graph.road.lanes import LaneConfig
    from jeat_graph.road.motion_fit import MotionFitConfig
    from jeat_graph.road.picture_crossings import agreement_notes, with_unplaced
    from jeat_graph.road.points_road import follow_points, summarise
    from jeat_graph.road.results import with_own_classes
    from jeat_graph.road.sources import boxes_of, contact_pixels, only_points, recording_span_of, run_table
    from jeat_graph.road.speeds import ContactConfig
    from jeat_graph.road.traffic import SummaryConfig
    from jeat_graph.road.writing import write_road

    clock_s(args.begin)  # refused before anything is read
    out = Path(args.out)
    check_folder(out)
    camera = read_camera(args.camera)
    marks = RoadMarks({}, {}) if args.lines is None else read_marks(args.lines)
    contact = ContactConfig()
    if args.contact_height is not None:
        contact = ContactConfig(height_m=args.contact_height[0], height_sd_m=args.contact_height[1])
    table = run_table(args.source)
    how: ReadingOptions = {
        **frames_read(args),
        "class_names": args.class_names,
        "image": (camera.width, camera.height),
    }
    if args.contact == "cuboid" or (args.contact is None and not only_points(table)):
        if only_points(table):
            raise DataError("has points only, no boxes: --contact cuboid needs boxes, use center", table)
        seen = boxes_of(args.source, camera, BoxConfig(), partial(say, "road"), sys.stderr.isatty(), **how)
        total = len(seen)
        with _bar(total) as bar:
            sized, left_out = follow_boxes(
                seen, camera, CuboidConfig(), BOX_MOTION, lambda done, _: _advance(bar, done), args.smoother
            )
        contact = ContactConfig(0.0, 0.0, 0.0)
        vehicles = [one.vehicle for one in sized]
    else:
        points = contact_pixels(args.source, args.contact, **how)
        total = len(points.tracks())
        sized = []
        with _bar(total) as bar:
            vehicles, left_out = follow_points(
                points, camera, MotionFitConfig(), contact, lambda done, _: _advance(bar, done)
            )
    span_s = recording_span_of(args.source, **how)
    result = summarise(vehicles, camera, marks, contact, LaneConfig(), sized, span_s, left_out)
    notes: list[str] = []
    if not only_points(table):
        boxes = read_trajectories(table, **how)
        result = with_own_classes(result, boxes.final_classes())
        result, agreements = with_unplaced(result, boxes, marks.lines)
        notes = agreement_notes(agreements)
    traffic = SummaryConfig(begin_s=later_s(args.begin, span_s[0], args.source))
    if args.interval is not None:
        traffic = replace(traffic, interval_s=args.interval)
    name = Path(args.source).name or str(args.source)
    write_road(result, camera, traffic, name, out, partial(with_clock, begin=args.begin))
    for text in [*_notes(result), *notes]:
        say("road", text)
    lanes, crossings = len(result.lanes.names), len(result.crossings)
    print(f"{len(vehicles)} vehicles, {lanes} lanes, {crossings} crossings: {out}")
    return 0


def _notes(result: RoadResult) -> list[str]:
    """Return what is not reported, and why."""
    notes = [
        f"{count} tracks are left out, {reason} (left_out.csv)"
        for reason, count in Counter(one.reason for one in result.left_out if not one.line).items()
    ]
    if result.vehicles and not result.lanes.names:
        notes.append("no lanes: the vehicles show none")
    unknown = sum(not math.isfinite(one.kmh) for one in result.speeds)
    if unknown:
        notes.append(f"of {unknown} vehicles the speed is not known well enough to be reported")
    if any(result.parked):
        notes.append(f"{sum(result.parked)} vehicles stood all the time (parked in speeds.csv)")
    return notes


def _bar(total: int) -> Any:
    from tqdm import tqdm

    return tqdm(total=total, desc="road", unit="vehicle", disable=not sys.stderr.isatty(), leave=False)


def _advance(bar: Any, done: int) -> None:
    bar.update(done - bar.n)
