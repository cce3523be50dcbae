"""What `register` reads of a calibration pattern: pictures, videos and events of two sensors."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jeat_graph.config.argument_types import positive
from jeat_graph.data.errors import DataError

if TYPE_CHECKING:
    from jeat_graph.data.picture_map import PictureMap
    from jeat_graph.rig.pattern import Corners, Pattern, PatternPlace, Picture

_VIDEOS = (".mp4", ".avi", ".mkv", ".mov", ".webm", ".m4v")
# Pictures that are looked at of a video or of events in which the pattern stands still, and how long events
# are counted for each (µs).
_SAMPLED, _WINDOW_US = 12, 250_000


def named_path(text: str) -> tuple[str, str]:
    """Read `NAME=FILE`."""
    name, equals, file = text.partition("=")
    if not equals or not name or not file:
        raise argparse.ArgumentTypeError(f"must read NAME=FILE, say evt=camera.yaml, not {text!r}")
    return name, file


class PatternMap(NamedTuple):
    """What a pattern tells.

    Attributes:
        names: of the sensor whose picture is the common one, and of the other.
        sizes: width and height of their pictures (px).
        way: from the other's picture to the common one.
        lines: to be reported.
    """

    names: tuple[str, str]
    sizes: tuple[tuple[int, int], tuple[int, int]]
    way: PictureMap
    lines: list[str]


class _Seen(NamedTuple):
    where: str
    size: tuple[int, int]
    corners: Corners


def add_pattern(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of registering by a pattern."""
    group = parser.add_argument_group("by a calibration pattern")
    group.add_argument(
        "--pattern",
        metavar="KIND:COLSxROWS",
        help="what both cameras saw: checkerboard:9x6 (inner corners), circles:9x6, staggered-circles:4x11, "
        "or charuco:8x6:4X4_50 (squares, markers)",
    )
    group.add_argument(
        "--pattern-side",
        type=positive,
        metavar="M",
        help="side of its squares, or distance of its circles (m): with --camera NAME=CAMERA.yaml of the "
        "reference, it tells the other camera's lens and place, and boxes go with parallax",
    )
    group.add_argument(
        "--view",
        action="append",
        default=[],
        type=named_path,
        metavar="NAME=PATH",
        help="pictures of the pattern by a sensor, its k-th place with the other's k-th: a picture, a video "
        "or a file of events in which it stands still at one place, or a folder with a picture of each "
        "place; say --view rgb=places/ --view evt=first.raw --view evt=second.raw",
    )


def map_of_pattern(args: argparse.Namespace, reference: str | None) -> PatternMap:
    """Find the pattern in all views of two sensors, and the map that it tells.

    Args:
        args: of the command.
        reference: the sensor whose picture is the common one; None for the one that is named first.

    Raises:
        DataError: the views are not of two sensors, places are missing, the pattern is not found, or it
            tells no map; names the file.
    """
    from jeat_graph.rig.pattern import Pattern, map_of_places

    pattern = Pattern.parse(args.pattern)
    names = list(dict.fromkeys(name for name, _ in args.view))
    if len(names) != 2:
        raise DataError(f"--pattern needs --view NAME=PATH of two sensors, and there are {len(names)}")
    if reference is not None and reference not in names:
        raise DataError(f"--reference {reference}: there are {', '.join(names)}")
    names.sort(key=lambda name: reference is not None and name != reference)
    given = dict(args.sensor_image)
    seen = [
        [one for other, path in args.view if other == name for one in _views(path, pattern, given.get(name))]
        for name in names
    ]
    sizes = [_one_size(views) for views in seen]
    if len(seen[0]) != len(seen[1]):
        raise DataError(
            f"{names[0]} saw the pattern at {len(seen[0])} places, {names[1]} at {len(seen[1])}: give as "
            "many of both"
        )
    places = [_place(*pair) for pair in zip(*seen, strict=True)]
    if args.camera:
        way, lines = _with_camera(args, places, pattern, names[0], sizes)
    else:
        way, lines = map_of_places(places, float(sizes[0][0]), sizes[1])
    return PatternMap((names[0], names[1]), (sizes[0], sizes[1]), way, lines)


def _with_camera(
    args: argparse.Namespace,
    places: list[PatternPlace],
    pattern: Pattern,
    reference: str,
    sizes: list[tuple[int, int]],
) -> tuple[PictureMap, list[str]]:
    from jeat_graph.road.camera_file import read_camera
    from jeat_graph.road.pattern_pose import map_by_pattern

    if [name for name, _ in args.camera] != [reference] or args.pattern_side is None:
        raise DataError(f"with --pattern goes --camera {reference}=CAMERA.yaml alone, and --pattern-side M")
    file = args.camera[0][1]
    first = read_camera(file)
    if (first.width, first.height) != sizes[0]:
        raise DataError(
            f"is of pictures of {first.width} x {first.height} px, and those of {reference} have "
            f"{sizes[0][0]} x {sizes[0][1]}",
            file,
        )
    return map_by_pattern(places, pattern, args.pattern_side, first, sizes[1])


def _place(first: _Seen, second: _Seen) -> PatternPlace:
    from jeat_graph.rig.pattern import same_place

    return same_place(first.corners, second.corners, f"{first.where} + {second.where}")


def _one_size(views: Sequence[_Seen]) -> tuple[int, int]:
    other = next((one for one in views if one.size != views[0].size), None)
    if other is not None:
        raise DataError(
            f"is of {other.size[0]} x {other.size[1]} px, and {views[0].where} is not", other.where
        )
    return views[0].size


def _views(path: str, pattern: Pattern, size_px: tuple[int, int] | None) -> Iterator[_Seen]:
    """Corners of each place that a path shows; the size is for files of events that do not say theirs."""
    from jeat_graph.io.media.decoders import PICTURES
    from jeat_graph.io.media.picture_file import read_picture
    from jeat_graph.io.media.video import open_frames
    from jeat_graph.rig.pattern import corners_of_place

    place, suffix = Path(path), Path(path).suffix.lower()
    if place.is_dir():
        with open_frames(place, rate_hz=1.0) as frames:
            for k in range(len(frames)):
                where = f"{path}, picture {k + 1}"
                yield _Seen(where, frames.size_px, corners_of_place([frames.frame(k)], pattern, where))
    elif suffix in PICTURES:
        picture = read_picture(path)
        size = (picture.shape[1], picture.shape[0])
        yield _Seen(path, size, corners_of_place([picture[..., ::-1]], pattern, path))
    elif suffix in _VIDEOS:
        with open_frames(place, rate_hz=1.0) as frames:
            chosen = np.unique(np.linspace(0, len(frames) - 1, _SAMPLED).round().astype(np.int64))
            pictures = (frames.frame(int(k)) for k in chosen)
            yield _Seen(path, frames.size_px, corners_of_place(pictures, pattern, path))
    else:
        size, counted = _counted(place, size_px)
        yield _Seen(path, size, corners_of_place(counted, pattern, path))


def _counted(path: Path, size_px: tuple[int, int] | None) -> tuple[tuple[int, int], list[Picture]]:
    """Pictures of the numbers of events: of all, and of the first stretches.

    Raises:
        DataError: the file does not say the size of its picture, or holds no event.
    """
    from jeat_graph.io.events.opening import open_events
    from jeat_graph.rig.pattern import picture_of_counts

    with open_events(path, size_px) as reader:
        size = reader.size_px
        if size is None:
            raise DataError(
                "does not say the size of its picture: give it with --sensor-image NAME=WxH", path
            )
        windows = np.zeros((_SAMPLED + 1, size[1] * size[0]), dtype=np.int64)
        start = None
        for piece in reader.pieces():
            if not len(piece):
                continue
            start = int(piece.t_us[0]) if start is None else start
            inside = (piece.x < size[0]) & (piece.y < size[1])
            pixel = (piece.y.astype(np.int64) * size[0] + piece.x)[inside]
            window = np.minimum((piece.t_us[inside] - start) // _WINDOW_US, _SAMPLED)
            for k in np.unique(window):
                windows[k] += np.bincount(pixel[window == k], minlength=windows.shape[1])
    if start is None:
        raise DataError("holds no events", path)
    pictures = [windows.sum(axis=0), *(one for one in windows[:_SAMPLED] if one.any())]
    return size, [picture_of_counts(one.reshape(size[1], size[0])) for one in pictures]
