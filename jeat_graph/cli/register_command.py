"""`jeat-graph register`: the pictures and clocks of several sensors brought together, from what they saw."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jeat_graph.cli.options import add_image, add_reading, add_rig, reading
from jeat_graph.cli.progress import stages
from jeat_graph.cli.register_pattern import add_pattern, map_of_pattern, named_path
from jeat_graph.cli.terminal import say
from jeat_graph.config.argument_types import picture_size
from jeat_graph.data.errors import DataError

if TYPE_CHECKING:
    from jeat_graph.cli.register_pattern import PatternMap
    from jeat_graph.config.schema import Config
    from jeat_graph.data.detections import Detections
    from jeat_graph.data.picture_map import PictureMap
    from jeat_graph.rig.matching import MatchedTracks
    from jeat_graph.rig.registering import Registration
    from jeat_graph.rig.sensor_tracks import SensorTracks

WRITES = ("out",)
HELP = (
    "estimate the map and the clock offset between two or more sensors, from traffic, points "
    "or a pattern; write a rig for track, stream and calibrate"
)
_say = partial(say, "register")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = parser.add_argument
    add(
        "detections",
        nargs="*",
        metavar="DETECTIONS",
        help="files of detections, with one sensor or several each; boxes are in the sensor's own "
        "picture, times on its own clock (optional with --pattern, where they give the clock)",
    )
    add("--out", required=True, metavar="RIG.yaml", help="the rig to write")
    add(
        "--reference",
        metavar="NAME",
        help="sensor whose picture and clock are the common ones (default: the first file's)",
    )
    add_image(parser)
    add(
        "--sensor-image",
        action="append",
        default=[],
        type=_named_size,
        metavar="NAME=WxH",
        help="size of another sensor's picture (default: the range of its boxes)",
    )
    add(
        "--points",
        metavar="FILE",
        help="corresponding points of two sensors (px): columns such as rgb_x, rgb_y, evt_x, evt_y",
    )
    add(
        "--camera",
        action="append",
        default=[],
        type=named_path,
        metavar="NAME=CAMERA.yaml",
        help="calibrated camera of a sensor over the road, one for each of two sensors, in the same axes",
    )
    add_pattern(parser)
    add_rig(parser)
    add_reading(parser)


def run(args: argparse.Namespace) -> int:
    """Register every other sensor with the reference, and write the rig if all of it is known."""
    from jeat_graph.io.files.atomic import check_writable
    from jeat_graph.io.tables.detections_io import read_many

    if Path(args.out).suffix not in (".yaml", ".yml"):
        raise DataError("the name of a rig must end in .yaml", args.out)
    check_writable(args.out)
    _check_ways(args)
    if not args.detections:
        return _write_pattern(args, map_of_pattern(args, args.reference))
    recording = read_many(args.detections, **{**reading(args), "image": None})
    reference = _reference(args, recording)
    others = [name for name in recording.sensors if name != reference]
    if not others:
        raise DataError(
            f"there is one sensor, {reference!r}: a rig has two or more", " + ".join(args.detections)
        )
    if args.camera and args.pattern is None and {name for name, _ in args.camera} != set(recording.sensors):
        raise DataError(f"--camera is needed of each sensor: {', '.join(recording.sensors)}")
    if args.points is not None and len(others) > 1:
        raise DataError("corresponding points are of two sensors, and there are more", args.points)
    pattern = None
    if args.pattern is not None:
        if {name for name, _ in args.view} != set(recording.sensors):
            raise DataError(f"--view is needed of each sensor: {', '.join(recording.sensors)}")
        pattern = map_of_pattern(args, reference)
    sizes = _sizes(args, recording, reference, pattern)
    known = _known(args)
    with stages("register", 2 * len(others) + 1) as stage:
        stage(f"tracking {reference}")
        first = _tracks(recording, reference, sizes[reference])
        found: dict[str, Registration] = {}
        for name in others:
            stage(f"tracking {name}")
            second = _tracks(recording, name, sizes[name])
            stage(f"registering {name}")
            pair = (sizes[reference], sizes[name])
            found[name] = _register(args, first, second, (reference, name), pair, known, pattern)
    return _write(args, reference, sizes, found)


def _write(
    args: argparse.Namespace,
    reference: str,
    sizes: dict[str, tuple[int, int]],
    found: dict[str, Registration],
) -> int:
    """Say what was found, and write the rig."""
    from jeat_graph.config.rig_file import rig_text, sensor_entry
    from jeat_graph.io.files.atomic import open_atomic

    for one in found.values():
        for line in one.lines:
            _say(line)
    width, height = sizes[reference]
    sensors: dict[str, dict[str, Any]] = {reference: {"image": [width, height], "to_picture": "none"}}
    sensors |= {name: sensor_entry(one.way, one.clock, sizes[name]) for name, one in found.items()}
    sources = args.detections or [path for _, path in args.view]
    notes = [
        f"made by jeat-graph register of {' + '.join(sources)}",
        *(line for one in found.values() for line in one.lines),
    ]
    with open_atomic(args.out) as file:
        file.write(rig_text((width, height), sensors, notes))
    print(f"wrote {args.out}")
    return 0


def _check_ways(args: argparse.Namespace) -> None:
    """Refuse more than one source of the map, and options that only mean something with another."""
    if not args.detections and args.pattern is None:
        raise DataError("DETECTIONS are needed, or a --pattern with --view NAME=PATH of two sensors")
    if args.view and args.pattern is None:
        raise DataError("--view shows a pattern: say which with --pattern, such as checkerboard:9x6")
    if args.pattern_side is not None and not (args.pattern and args.camera):
        raise DataError("--pattern-side goes with --pattern and --camera NAME=CAMERA.yaml of the reference")
    other = args.pattern or args.camera
    if args.points is not None and other:
        name = "pattern" if args.pattern else "camera"
        raise DataError(f"--{name} and --points both tell the map: give one of them")


def _write_pattern(args: argparse.Namespace, pattern: PatternMap) -> int:
    """Write what a pattern tells, without any traffic."""
    from jeat_graph.rig.registering import Registration

    reference, name = pattern.names
    lines = [*pattern.lines, "no detections, so no clock: give them, or write offset_s into the rig"]
    found = {name: Registration(pattern.way, None, [f"{name}: {line}" for line in lines])}
    return _write(args, reference, dict(zip(pattern.names, pattern.sizes, strict=True)), found)


def _reference(args: argparse.Namespace, recording: Detections) -> str:
    from jeat_graph.io.tables.detections_io import read_many

    if args.reference is not None:
        if args.reference not in recording.sensors:
            raise DataError(f"--reference {args.reference}: there are {', '.join(recording.sensors)}")
        return str(args.reference)
    if len(args.detections) == 1:
        return recording.sensors[-1] if "rgb" not in recording.sensors else "rgb"
    first = read_many(args.detections[:1], **{**reading(args), "image": None})
    return first.sensors[-1] if "rgb" not in first.sensors else "rgb"


def _sizes(
    args: argparse.Namespace, recording: Detections, reference: str, pattern: PatternMap | None
) -> dict[str, tuple[int, int]]:
    """Width and height of each sensor's picture, given or as far as its boxes reach."""
    from jeat_graph.config.reading import load_config
    from jeat_graph.runs.declaring import fit_picture

    given = {name: _camera_size(file) for name, file in args.camera} | dict(args.sensor_image)
    if pattern is not None:
        given |= dict(zip(pattern.names, pattern.sizes, strict=True))
    if args.image is not None:
        given[reference] = args.image
    strange = [name for name in given if name not in recording.sensors]
    if strange:
        raise DataError(f"--sensor-image {strange[0]}: there are {', '.join(recording.sensors)}")
    out = {}
    for name in recording.sensors:
        if name in given:
            out[name] = given[name]
            continue
        image = fit_picture(load_config("default"), [recording.select(name)]).image
        out[name] = (round(image.width), round(image.height))
        option = "--image " if name == reference else f"--sensor-image {name}="
        _say(
            f"sensor {name!r}: the picture is taken for {out[name][0]} x {out[name][1]} px, as far as its "
            f"boxes reach ({option}WxH says otherwise)"
        )
    return out


def _known(args: argparse.Namespace) -> Config | None:
    from jeat_graph.config.reading import load_config

    return None if args.rig is None else load_config("default", rig=args.rig)


def _tracks(recording: Detections, name: str, size: tuple[int, int]) -> SensorTracks:
    from jeat_graph.runs.own_tracks import own_tracks

    return own_tracks(recording.select(name), size)


def _register(
    args: argparse.Namespace,
    first: SensorTracks,
    second: SensorTracks,
    names: tuple[str, str],
    sizes: tuple[tuple[int, int], tuple[int, int]],
    known: Config | None,
    pattern: PatternMap | None,
) -> Registration:
    from jeat_graph.rig.points import map_of_points, read_points
    from jeat_graph.rig.registering import Registration, clock_by_map, register_by_traffic

    if args.points is not None:
        way, lines = map_of_points(*read_points(args.points, names), sizes[0], args.points)
    elif pattern is not None:
        way, lines = pattern.way, list(pattern.lines)
    elif args.camera:
        way, lines = _map_of_cameras(dict(args.camera), names)
    else:
        return register_by_traffic(first, second, names, sizes, _start(known, names[1]))
    clock = clock_by_map(first, second, way)
    if clock is None:
        lines.append(
            f"the traffic does not tell the clock of {names[1]}: its times are left as they are; if they are "
            "not the common ones, write offset_s into the rig"
        )
    else:
        lines.append(
            f"clock {clock.offset_s:.4f} s ± {1e3 * clock.offset_std_s:.1f} ms ahead, by the traffic"
        )
    return Registration(way, clock, [f"{names[1]}: {line}" for line in lines])


def _map_of_cameras(cameras: dict[str, str], names: tuple[str, str]) -> tuple[PictureMap, list[str]]:
    from jeat_graph.road.camera_file import read_camera
    from jeat_graph.road.camera_map import map_between

    common, own = (read_camera(cameras[name]) for name in names)
    way, left = map_between(own, common)
    return way, [f"the cameras' files tell the map, to {left:.2g} px for vehicles on the road"]


def _camera_size(file: str) -> tuple[int, int]:
    from jeat_graph.road.camera_file import read_camera

    camera = read_camera(file)
    return camera.width, camera.height


def _start(known: Config | None, name: str) -> MatchedTracks | None:
    """What an earlier rig says of a sensor, to begin with."""
    from jeat_graph.rig.common_picture import CommonPicture
    from jeat_graph.rig.matching import MatchedTracks, no_tracks

    if known is None or name not in known.sensors:
        return None
    way = CommonPicture.of(known).ways.get(name)
    if way is None or way.picture is None:
        return None
    offset = 0.0 if way.clock is None else way.clock.offset_s
    return MatchedTracks(no_tracks(), no_tracks(), way.picture, offset, 0)


def _named_size(text: str) -> tuple[str, tuple[int, int]]:
    name, equals, size = text.partition("=")
    if not equals or not name:
        raise argparse.ArgumentTypeError(f"must read NAME=WIDTHxHEIGHT, say evt=640x480, not {text!r}")
    return name, picture_size(size)
