"""Scans from a stream of lines, one after another as they come: JSON, or rows of CSV."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

from jeat_graph.data.errors import DataError
from jeat_graph.data.scan import Scan, scan_with_area
from jeat_graph.io.scan_batch import ScanBatch, Trying, in_order, joined
from jeat_graph.io.scan_rows import csv_batches, csv_columns
from jeat_graph.io.stream_text import decode_line

_KEYS = ("t", "sensor", "boxes", "scores")
_CLASSES = "classes"  # may follow: names, one a box
_EMBEDDINGS = "embeddings"  # likewise: lists of numbers, or null
_MORE = (_CLASSES, _EMBEDDINGS)


def read_batches(
    lines: Iterable[bytes],
    name: str,
    *,
    joint: bool = False,
    ordered: bool = True,
    bad: Callable[[DataError], object] | None = None,
) -> Iterator[ScanBatch]:
    """Read scans as their lines arrive.

    A line of JSON is one scan, `{"t": 0.05, "sensor": "rgb", "boxes": [[l, t, w, h], …], "scores": [s, …]}`,
    maybe with `"classes": [name, …]`, or a list of scans of one time. It is given out at once; with `joint`
    only when a later time is seen, so that scans of one time that came in lines of their own are given out
    together.

    CSV begins with a header and has one row a detection; a row with only `t` and `sensor` is a scan that
    found nothing. Rows of one time are given out together, when a row of another time or an empty line
    arrives, or at the end.

    Boxes without area are left out and counted; their scan is there all the same.

    Args:
        lines: lines with their ends.
        name: name of the stream, for messages.
        joint: wait for a later time.
        ordered: refuse a scan that is older than the one held back; otherwise it is given out before that
            one is.
        bad: takes the error of a line that cannot be read, which is then passed over; None raises it.

    Raises:
        DataError: names the stream, the line, and what is wrong.
    """
    numbered = enumerate(lines, start=1)
    trying = Trying(bad)
    for number, line in numbered:
        text = trying(decode_line, line, name, number)
        if not text:
            continue
        if text.startswith(("{", "[")):
            parts = _json_batches(text, number, numbered, name, trying)
            yield from joined(parts, name, ordered) if joint else parts
            return
        columns = trying(csv_columns, text, name, number)
        if columns is not None:
            yield from joined(csv_batches(columns, numbered, name, trying), name, ordered)
            return


def _json_batches(
    text: str, number: int, numbered: Iterator[tuple[int, bytes]], name: str, trying: Trying
) -> Iterator[ScanBatch]:
    first = trying(_json_batch, text, name, number)
    if first is not None:
        yield first
    for after, line in numbered:
        found = trying(decode_line, line, name, after)
        batch = trying(_json_batch, found, name, after) if found else None
        if batch is not None:
            yield batch


def _json_batch(text: str, name: str, number: int) -> ScanBatch:
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        what = error.msg if isinstance(error, json.JSONDecodeError) else str(error)
        what += "; a scan must be whole on its line" if text in ("[", "{") else ""
        raise DataError(f"is not JSON: {what}", name, number) from None
    return batch_of(content, name, number)


def batch_of(content: Any, name: str, number: int) -> ScanBatch:
    """Make a batch of a scan, or a list of scans of one time, that was read from JSON or the like.

    Args:
        content: a mapping with `t`, `sensor`, `boxes`, `scores`, or a list of such.
        name: name of the stream, for messages.
        number: number of the line or message.

    Raises:
        DataError: names the stream, the line, and what is wrong.
    """
    items = content if isinstance(content, list) else [content]
    if not items:
        raise DataError("a list of scans must hold at least one", name, number)
    found = [_scan_of(item, name, number) for item in items]
    scans = [scan for scan, _ in found]
    if any(scan.t != scans[0].t for scan in scans):
        raise DataError("the scans of one line must have one and the same t", name, number)
    return in_order(ScanBatch(scans, [number] * len(scans), sum(flat for _, flat in found)))


def _scan_of(item: Any, name: str, number: int) -> tuple[Scan, int]:
    """The scan, and how many boxes without area were left out of it."""
    example = '{"t": 0.05, "sensor": "rgb", "boxes": [[10, 20, 30, 40]], "scores": [0.9]}'
    if not isinstance(item, dict):
        raise DataError(f"a scan is an object such as {example}", name, number)
    strange = next((key for key in item if key not in (*_KEYS, *_MORE)), None)
    if strange is not None:
        known = ", ".join((*_KEYS, *_MORE))
        raise DataError(f"unknown key {strange!r}; a scan has {known}", name, number)
    missing = next((key for key in _KEYS if key not in item), None)
    if missing is not None:
        raise DataError(f"{missing} is missing; a scan has {', '.join(_KEYS)}", name, number)
    t, sensor = item["t"], item["sensor"]
    if isinstance(t, bool) or not isinstance(t, int | float):
        raise DataError(f"t must be a number of seconds, got {t!r}", name, number)
    if not isinstance(sensor, str) or not sensor:
        raise DataError(f"sensor must be a name, got {sensor!r}", name, number)
    try:
        kinds = _class_names(item.get(_CLASSES), name, number)
        looks = _with_blanks(item.get(_EMBEDDINGS))
        return scan_with_area(t, sensor, item["boxes"], item["scores"], kinds, looks)
    except DataError as error:
        raise DataError(error.message, name, number) from None
    except OverflowError:
        raise DataError("t is too large", name, number) from None


def _class_names(found: Any, name: str, number: int) -> Any:
    """The names of classes in a scan, None if it has none.

    Raises:
        DataError: not a list of text (null where a class is not known).
    """
    if found is None:
        return None
    if not isinstance(found, list) or not all(one is None or isinstance(one, str) for one in found):
        raise DataError(f"{_CLASSES} must be a list of names, one a box, got {found!r}", name, number)
    return np.array([one or "" for one in found], dtype=np.str_)


def _with_blanks(found: Any) -> Any:
    """Lists of numbers, one a box, with NaN in place of null."""
    if not isinstance(found, list) or None not in found:
        return found
    numbers = next((len(one) for one in found if isinstance(one, list)), 1)
    return [[math.nan] * numbers if one is None else one for one in found]
