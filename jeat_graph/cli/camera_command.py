"""`jeat-graph camera`: calibrate a fixed camera over a road, and show what a calibration says."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from jeat_graph.cli.options import add_frames, frames_read
from jeat_graph.cli.progress import stages
from jeat_graph.cli.terminal import say
from jeat_graph.config.argument_types import picture_size
from jeat_graph.data.errors import DataError

WRITES = ("out",)
HELP = "calibrate a camera over a road from lengths, points and the vehicles' tracks, or show one"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    finding = actions.add_parser("calibrate", help="estimate a camera from lengths, points and tracks")
    add = finding.add_argument
    add(
        "--run",
        dest="tracks",
        metavar="RUN",
        help="run directory, trajectory table, another tracker's result, or table of t, track_id, x, y",
    )
    add_frames(finding)
    add("--lengths", metavar="FILE", help="measured lengths: x1, y1, x2, y2 (px), metres, along or across")
    add("--points", metavar="FILE", help="surveyed points: x, y (px), east, north (m)")
    add(
        "--camera",
        metavar="CAMERA.yaml",
        help="a camera calibrated before, with its covariance: tracks and lengths sharpen it",
    )
    add("--zone", default="", metavar="UTM", help="UTM zone of the points, such as 33N, for maps")
    add(
        "--image",
        type=picture_size,
        metavar="WxH",
        help="size of the picture in px (default: that of the run)",
    )
    add("--out", required=True, metavar="CAMERA.yaml", help="the calibrated camera")
    show = actions.add_parser(
        "show", help="describe a camera file in words, or draw the road's grid"
    ).add_argument
    show("camera", metavar="CAMERA.yaml", help="the camera")
    show("--picture", metavar="FILE.png", help="draw the road's grid as the camera sees it")
    show("--frame", metavar="FILE", help="picture of the camera to draw it over")


def run(args: argparse.Namespace) -> int:
    """Do what was asked for."""
    return _show(args) if args.action == "show" else _calibrate(args)


def _calibrate(args: argparse.Namespace) -> int:
    from jeat_graph.data.tables.reading import ReadingOptions
    from jeat_graph.road.calibrate import calibrate
    from jeat_graph.road.camera_file import read_camera, write_camera
    from jeat_graph.road.evidence import CalibrationConfig, thin
    from jeat_graph.road.inputs import read_lengths, read_surveyed_points
    from jeat_graph.road.report import calibration_lines
    from jeat_graph.road.residuals import Problem
    from jeat_graph.road.sources import box_sides, contact_pixels
    from jeat_graph.runs.beside import recorded_size

    if Path(args.out).suffix not in (".yaml", ".yml"):
        raise DataError("the name of a camera's file must end in .yaml", args.out)
    known = None if args.camera is None else read_camera(args.camera)
    if known is not None and args.lengths is None and args.tracks is None:
        raise DataError("nothing sharpens the camera: give --run or --lengths", args.camera)
    if args.lengths is None and args.points is None and args.tracks is None:
        raise DataError("nothing tells the scale: give --lengths or --points")
    config = CalibrationConfig()
    lengths = None if args.lengths is None else read_lengths(args.lengths)
    points = None if args.points is None else read_surveyed_points(args.points)
    size = args.image or (None if args.tracks is None else recorded_size(args.tracks))
    if known is not None:
        if size not in (None, (known.width, known.height)):
            raise DataError(
                f"is of {known.width} x {known.height} px, not {size[0]} x {size[1]}", args.camera
            )
        size = (known.width, known.height)
    if size is None:
        raise DataError("the size of the picture is not known: give --image WxH")
    width, height = size
    if not args.image and known is None:
        say(
            "camera",
            f"picture of {width} x {height} px, as {args.tracks} says (--image WxH says otherwise)",
        )
    tracks = None
    if args.tracks is not None:
        how: ReadingOptions = {**frames_read(args), "image": size}
        table, sides = contact_pixels(args.tracks, **how), box_sides(args.tracks, **how)
        tracks = thin(table.t, table.track_id, table.pixels, config, size, sides)
        if not len(tracks):
            say("camera", f"{args.tracks}: no track is long enough to help")
            tracks = None
    with stages("camera", 1) as stage:
        stage("fitting")
        calibration = calibrate(Problem(width, height, lengths, points, tracks, config, known), args.zone)
    lines = calibration_lines(calibration)
    write_camera(calibration.camera, args.out, lines)
    print("\n".join(lines))
    print(f"written: {args.out}", file=sys.stderr)
    return 0


def _show(args: argparse.Namespace) -> int:
    from jeat_graph.road.camera_file import read_camera
    from jeat_graph.road.report import camera_lines

    camera = read_camera(args.camera)
    print("\n".join(camera_lines(camera)))
    if args.frame is not None and args.picture is None:
        raise DataError("--frame is what to draw over: give --picture, too")
    if args.picture is not None:
        from jeat_graph.road.grid_picture import draw_grid

        draw_grid(camera, args.picture, args.frame)
        print(f"written: {args.picture}", file=sys.stderr)
    return 0
