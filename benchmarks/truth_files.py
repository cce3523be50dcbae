"""Truth of published data sets in formats that `jeat-graph` itself does not read: DSEC-MOT, OpenLABEL.

DSEC-MOT has a text file a sequence, seven numbers a line: time (µs), track, left, top, width, height (px) and
class. TUMTraf has OpenLABEL files (ASAM, 2021), one a picture: boxes are centre and size in pixels, and an
object has the same key in every file of its recording.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.io.tables.plain_text import read_plain

_DSEC_MOT = ("t_us", "id", "left", "top", "width", "height", "class")
_DSEC_MOT_CLASSES = ("car", "pedestrian", "bicycle", "motorcycle", "bus", "truck", "train")
_SEVEN_NUMBERS = re.compile(rb"\s*[\d.]+(?:\s*[,\s]\s*-?[\d.]+){6}\s*")
#: Names of pictures: seconds and nanoseconds since 1970, or date and time of day.
_UNIX_NAME = re.compile(r"^(\d{10})_(\d{9})(?:_|$)")
_DATE_NAME = re.compile(r"^(\d{8}-\d{6}\.\d{1,6})(?:_|$)")


def is_dsec_mot(path: Path) -> bool:
    """Say whether the first line of a file has seven numbers."""
    with path.open("rb") as file:
        return _SEVEN_NUMBERS.fullmatch(file.readline(200)) is not None


def read_dsec_mot(path: Path) -> GroundTruth:
    """Read a sequence of DSEC-MOT.

    Raises:
        DataError: names the first line that is wrong: its fields, a class that is not there, a size below 0,
            or an object twice at one time.
    """
    table = read_plain(path, {len(_DSEC_MOT): _DSEC_MOT}, "DSEC-MOT")
    number = table.whole("class")
    unknown = (number < 0) | (number >= len(_DSEC_MOT_CLASSES))
    if unknown.any():
        row = int(np.argmax(unknown))
        raise table.error(row, f"class {number[row]}: DSEC-MOT has 0 to {len(_DSEC_MOT_CLASSES) - 1}")
    boxes = np.stack([table.number(name) for name in ("left", "top", "width", "height")], axis=1)
    t_us, identity = table.whole("t_us"), table.whole("id")
    negative = (boxes[:, 2:] < 0.0).any(axis=1)
    if negative.any():
        raise table.error(int(np.argmax(negative)), "a negative width or height")
    _, first = np.unique(np.stack([t_us, identity]), axis=1, return_index=True)
    if len(first) < len(t_us):
        row = int(np.setdiff1d(np.arange(len(t_us)), first)[0])
        raise table.error(row, f"track {identity[row]} is there twice at {t_us[row]} µs")
    return GroundTruth(
        t=np.asarray(1e-6 * t_us, dtype=np.float64),
        object_id=identity,
        boxes=boxes,
        motion=None,
        ignore=np.zeros(len(t_us), dtype=np.bool_),
        classes=np.array(_DSEC_MOT_CLASSES, dtype=object)[number],
    )


def is_openlabel(folder: Path) -> bool:
    """Say whether the first JSON file of a folder is an OpenLABEL file with boxes in the picture."""
    first = min(folder.glob("*.json"))
    try:
        found = json.loads(first.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError):
        return False
    return isinstance(found, dict) and "frames" in _openlabel(found) and '"bbox"' in json.dumps(found)


def read_openlabel(folder: Path) -> GroundTruth:
    """Read the boxes of a folder with one OpenLABEL file a picture.

    Times are those of `frame_properties.timestamp` (s), else of the files' names, from the first picture on.
    Identities are the keys of the objects.

    Raises:
        DataError: a file that is not OpenLABEL, says no time, or holds a box that is none; or keys that count
            from 0 again in each file, by which no object can be followed.
    """
    frames: list[float] = []
    rows: list[tuple[float, str, list[float], str]] = []
    counted = True
    for path in sorted(folder.glob("*.json")):
        for t, objects in _frames(path):
            frames.append(t)
            keys = [key for key, one in objects.items() for _ in _boxes(path, one)]
            counted &= sorted(keys) == sorted(map(str, range(len(keys))))
            for key, one in objects.items():
                rows += [(t, key, box, name) for box, name in _boxes(path, one)]
    if counted and rows:
        raise DataError("objects are numbered from 0 in each file: no identity to judge tracks by", folder)
    numbers = {key: k for k, key in enumerate(dict.fromkeys(key for _, key, _, _ in rows))}
    centre = np.array([box for _, _, box, _ in rows], dtype=np.float64).reshape(-1, 4)
    origin = min(frames, default=0.0)
    return GroundTruth(
        t=np.array([t for t, _, _, _ in rows], dtype=np.float64) - origin,
        object_id=np.array([numbers[key] for _, key, _, _ in rows], dtype=np.int64),
        boxes=np.concatenate([centre[:, :2] - 0.5 * centre[:, 2:], centre[:, 2:]], axis=1),
        motion=None,
        ignore=np.zeros(len(rows), dtype=np.bool_),
        classes=np.array([name for _, _, _, name in rows], dtype=object),
        frames=_ascending(np.array(frames) - origin, folder),
    )


def _openlabel(found: Mapping[str, Any]) -> Mapping[str, Any]:
    held = found.get("openlabel")
    return held if isinstance(held, dict) else {}


def _frames(path: Path) -> Iterator[tuple[float, Mapping[str, Any]]]:
    """Time (s) and objects by key, of each frame of a file."""
    try:
        frames = _openlabel(json.loads(path.read_text(encoding="utf-8")))["frames"]
        for frame in frames.values():
            yield _time(path, frame.get("frame_properties", {})), frame.get("objects", {})
    except (OSError, UnicodeDecodeError, json.JSONDecodeError, KeyError, AttributeError) as error:
        raise DataError(f"is no OpenLABEL file: {type(error).__name__} {error}", path) from None


def _time(path: Path, properties: Mapping[str, Any]) -> float:
    stamp = properties.get("timestamp")
    if stamp is not None:
        try:
            return float(stamp)
        except (TypeError, ValueError):
            raise DataError(f"timestamp {stamp!r} is no number of seconds", path) from None
    if found := _UNIX_NAME.match(path.stem):
        return int(found[1]) + 1e-9 * int(found[2])
    if found := _DATE_NAME.match(path.stem):
        return datetime.strptime(found[1], "%Y%m%d-%H%M%S.%f").replace(tzinfo=UTC).timestamp()
    raise DataError("neither frame_properties.timestamp nor its name says its time", path)


def _boxes(path: Path, one: Mapping[str, Any]) -> Iterator[tuple[list[float], str]]:
    """Centre and size (px), and class, of the first box of an object; nothing where it has none."""
    data = one.get("object_data", {})
    for box in data.get("bbox", [])[:1]:
        value = box.get("val")
        fits = isinstance(value, list) and len(value) == 4 and all(isinstance(v, int | float) for v in value)
        if not fits or min(value[2:]) < 0.0:
            raise DataError(f"bbox {value!r} is not [centre x, centre y, width, height]", path)
        yield value, str(data.get("type", "")).lower()


def _ascending(frames: FloatArray, folder: Path) -> FloatArray:
    found: FloatArray = np.unique(frames)
    if len(found) < len(frames):
        raise DataError("two files are of one time", folder)
    return found
