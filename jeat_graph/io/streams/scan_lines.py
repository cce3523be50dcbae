"""Scans from a stream of lines, one after another as they come: JSON, or rows of CSV."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

from jeat_graph.data.arrays import TextArray
from jeat_graph.data.camera_motion import CAMERA_MOTION
from jeat_graph.data.column_names import DEFAULT_SENSOR, FRAME_COLUMNS, TIME_COLUMNS
from jeat_graph.data.errors import DataError
from jeat_graph.data.scan import Scan
from jeat_graph.data.tables.spreadsheets import is_number
from jeat_graph.io.streams.scan_batch import ScanBatch, Trying, in_order, joined
from jeat_graph.io.streams.scan_rows import csv_batches, csv_columns
from jeat_graph.io.streams.stream_reading import StreamReading, video_of_picture
from jeat_graph.io.streams.stream_text import decode_line

_KEYS = ("t", "sensor", "boxes", "scores")
#: What may stand for `t`: a time in another unit, the number of a frame, the name of a picture.
_TIMES = ("t", *TIME_COLUMNS, *FRAME_COLUMNS)
# What may follow, one entry a box: names of classes, their numbers, lists of numbers or null; and the video.
_CLASSES, _CLASS_ID, _EMBEDDINGS, _STD, _VIDEO = "classes", "class_id", "embeddings", "box_std", "video"
#: Identities that another tracker has given: passed over, as they are in tables.
_PASSED_OVER = ("tracker_id", "track_id")
_MORE = (_CLASSES, _CLASS_ID, _EMBEDDINGS, _STD, CAMERA_MOTION, _VIDEO)
_KNOWN = frozenset((*_KEYS, *_TIMES, *_MORE, *_PASSED_OVER))


def read_batches(
    lines: Iterable[bytes],
    name: str,
    *,
    joint: bool = False,
    within_s: float = 0.0,
    ordered: bool = True,
    bad: Callable[[DataError], object] | None = None,
    how: StreamReading | None = None,
) -> Iterator[ScanBatch]:
    """Read scans as their lines arrive.

    A line of JSON is one scan, `{"t": 0.05, "sensor": "rgb", "boxes": [[l, t, w, h], …], "scores": [s, …]}`,
    or a list of scans of one time. Without `scores` each is 1; `classes` (names or numbers), `class_id`,
    `embeddings` and `box_std` may follow, and `camera_motion` of the scan. It is given out at once; with
    `joint` only when a later time is seen, so that scans of one time that came in lines of their own are
    given out together.

    CSV begins with a header and has one row a detection; a row with only `t` and `sensor` is a scan that
    found nothing. Columns and times are as in files (`column_names`). Rows of one time are given out
    together, when a row of another time or an empty line arrives, or at the end.

    Boxes without area are left out and counted; their scan is there all the same.

    Args:
        lines: lines with their ends.
        name: name of the stream, for messages.
        joint: wait for a later time.
        within_s: with `joint`, scans of different sensors no further apart (s) are of one time, too.
        ordered: refuse a scan that is older than the one held back; otherwise it is given out before that
            one is.
        bad: takes the error of a line that cannot be read, which is then passed over; None raises it.
        how: what the lines do not say themselves.

    Raises:
        DataError: names the stream, the line, and what is wrong.
    """
    how = StreamReading() if how is None else how
    numbered = enumerate(lines, start=1)
    trying = Trying(bad)
    for number, line in numbered:
        text = trying(decode_line, line, name, number)
        if not text:
            continue
        if text.startswith(("{", "[")):
            parts = _json_batches(text, number, numbered, name, (trying, how))
            yield from joined(parts, name, ordered, within_s) if joint else parts
            return
        columns = trying(csv_columns, text, name, number)
        if columns is not None:
            rows = csv_batches(columns, numbered, name, trying, how)
            yield from joined(rows, name, ordered, within_s if joint else 0.0)
            return


def _json_batches(
    text: str,
    number: int,
    numbered: Iterator[tuple[int, bytes]],
    name: str,
    reading: tuple[Trying, StreamReading],
) -> Iterator[ScanBatch]:
    trying, how = reading
    first = trying(_json_batch, text, name, number, how)
    if first is not None:
        yield first
    for after, line in numbered:
        found = trying(decode_line, line, name, after)
        batch = trying(_json_batch, found, name, after, how) if found else None
        if batch is not None:
            yield batch


def _json_batch(text: str, name: str, number: int, how: StreamReading) -> ScanBatch | None:
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        what = error.msg if isinstance(error, json.JSONDecodeError) else str(error)
        what += "; a scan must be whole on its line" if text in ("[", "{") else ""
        raise DataError(f"is not JSON: {what}", name, number) from None
    return batch_of(content, name, number, how)


def batch_of(content: Any, name: str, number: int, how: StreamReading | None = None) -> ScanBatch | None:
    """Make a batch of a scan, or a list of scans of one time, that was read from JSON or the like.

    Args:
        content: a mapping with `t`, `sensor`, `boxes`, `scores`, or a list of such.
        name: name of the stream, for messages.
        number: number of the line or message.
        how: what the scans do not say themselves.

    Returns:
        The batch; None where all of it is of a video that is not asked for.

    Raises:
        DataError: names the stream, the line, and what is wrong.
    """
    how = StreamReading() if how is None else how
    items = content if isinstance(content, list) else [content]
    if not items:
        raise DataError("a list of scans must hold at least one", name, number)
    try:
        found = [one for item in items if (one := _scan_of(item, how)) is not None]
    except DataError as error:
        raise DataError(error.message, name, number) from None
    except OverflowError:
        raise DataError("t is too large", name, number) from None
    if not found:
        return None
    scans = [scan for scan, _ in found]
    if any(scan.t != scans[0].t for scan in scans):
        raise DataError("the scans of one line must have one and the same t", name, number)
    return in_order(ScanBatch(scans, [number] * len(scans), sum(flat for _, flat in found)))


def _scan_of(item: Any, how: StreamReading) -> tuple[Scan, int] | None:
    """The scan, and how many boxes without area were left out of it; None of one of another video."""
    if not isinstance(item, dict):
        example = '{"t": 0.05, "sensor": "rgb", "boxes": [[10, 20, 30, 40]], "scores": [0.9]}'
        raise DataError(f"a scan is an object such as {example}")
    if not item.keys() <= _KNOWN:
        strange = next(key for key in item if key not in _KNOWN)
        raise DataError(f"unknown key {strange!r}; a scan has {', '.join((*_KEYS, *_MORE))}")
    times = [key for key in _TIMES if key in item]
    if len(times) > 1:
        raise DataError(f"has both {times[0]} and {times[1]}; give one time")
    if not times:
        raise DataError(f"t is missing; a scan has {', '.join(_KEYS)}")
    needed = ("boxes",) if times[0] in FRAME_COLUMNS else ("sensor", "boxes")
    missing = next((key for key in needed if key not in item), None)
    if missing is not None:
        raise DataError(f"{missing} is missing; a scan has {', '.join(_KEYS)}")
    sensor = item.get("sensor", DEFAULT_SENSOR)
    if not isinstance(sensor, str) or not sensor:
        raise DataError(f"sensor must be a name, got {sensor!r}")
    video = item.get(_VIDEO, video_of_picture(times[0], item[times[0]]))
    if video is not None and not how.takes_video(str(video)):
        return None
    if isinstance(item[times[0]], str) and is_number(item[times[0]]):
        raise DataError(f"{times[0]} must be a number, not one as text: {item[times[0]]!r:.60}")
    t = how.seconds(times[0], item[times[0]])
    boxes, scores = item["boxes"], item.get("scores")
    if scores is None:
        scores = np.ones(len(boxes) if hasattr(boxes, "__len__") else 0)
    vectors = _with_blanks(item.get(_EMBEDDINGS))
    motion, std = item.get(CAMERA_MOTION), _std_of(item)
    return how.scan(t, sensor, boxes, scores, _classes_of(item), vectors, motion, std)


def _classes_of(item: dict[Any, Any]) -> dict[str, TextArray]:
    """Classes in a scan by the names of their columns in tables.

    Raises:
        DataError: not a list of names or whole numbers (null where a class is not known).
    """
    found: dict[str, TextArray] = {}
    for key, column in ((_CLASSES, "class"), (_CLASS_ID, "class_id")):
        values = item.get(key)
        if values is None:
            continue
        if not isinstance(values, list) or not all(map(_is_class, values)):
            raise DataError(f"{key} must be a list of names or numbers, one a box, got {values!r:.80}")
        found[column] = np.array(["" if one is None else str(one) for one in values], dtype=np.str_)
    return found


def _std_of(item: dict[Any, Any]) -> Any:
    """Standard deviations of the sides of boxes, with NaN in place of null, for a box or for a side."""
    found = item.get(_STD)
    if not isinstance(found, list):
        return found
    return [
        [math.nan] * 4
        if one is None
        else [math.nan if side is None else side for side in one]
        if isinstance(one, list)
        else one
        for one in found
    ]


def _is_class(value: Any) -> bool:
    """Whether a value names a class, numbers it, or says that it is not known."""
    if value is None or isinstance(value, str):
        return True
    return isinstance(value, int | float) and not isinstance(value, bool) and float(value).is_integer()


def _with_blanks(found: Any) -> Any:
    """Lists of numbers, one a box, with NaN in place of null."""
    if not isinstance(found, list) or None not in found:
        return found
    numbers = next((len(one) for one in found if isinstance(one, list)), 1)
    return [[math.nan] * numbers if one is None else one for one in found]
