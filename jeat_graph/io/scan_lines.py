"""Scans from a stream of lines, one after another as they come: JSON, or rows of CSV."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple, TypeVar

import numpy as np

from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError
from jeat_graph.io.stream_text import decode_line

_KEYS = ("t", "sensor", "boxes", "scores")
_CLASSES = "classes"  # may follow: names, one a box
_EMBEDDINGS = "embeddings"  # likewise: lists of numbers, or null
_MORE = (_CLASSES, _EMBEDDINGS)
_Result = TypeVar("_Result")
_COLUMNS = ("t", "sensor", "left", "top", "width", "height", "score")
_CLASS = "class"  # a column that may be there


class ScanBatch(NamedTuple):
    """Scans of one time, to be taken jointly.

    Attributes:
        scans: at least one.
        lines: number of the line, from 1, that each scan began on.
    """

    scans: list[Scan]
    lines: list[int]

    @property
    def t(self) -> float:
        """Time of the scans (s)."""
        return self.scans[0].t


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
    trying = _Trying(bad)
    for number, line in numbered:
        text = trying(decode_line, line, name, number)
        if not text:
            continue
        if text.startswith(("{", "[")):
            parts = _json_batches(text, number, numbered, name, trying)
            yield from _joined(parts, name, ordered) if joint else parts
            return
        columns = trying(_csv_columns, text, name, number)
        if columns is not None:
            yield from _joined(_csv_batches(columns, numbered, name, trying), name, ordered)
            return


class _Trying:
    """Calls functions that may find a line bad; None where it was, and that is somebody's to hear."""

    def __init__(self, bad: Callable[[DataError], object] | None) -> None:
        self._bad = bad

    def __call__(self, read: Callable[..., _Result], *arguments: Any) -> _Result | None:
        try:
            return read(*arguments)
        except DataError as error:
            if self._bad is None:
                raise
            self._bad(error)
            return None


def _json_batches(
    text: str, number: int, numbered: Iterator[tuple[int, bytes]], name: str, trying: _Trying
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
    scans = [_scan_of(item, name, number) for item in items]
    if any(scan.t != scans[0].t for scan in scans):
        raise DataError("the scans of one line must have one and the same t", name, number)
    return _in_order(ScanBatch(scans, [number] * len(scans)))


def _scan_of(item: Any, name: str, number: int) -> Scan:
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
        return Scan(t, sensor, item["boxes"], item["scores"], kinds, _with_blanks(item.get(_EMBEDDINGS)))
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


class _Row(NamedTuple):
    t: float
    sensor: str
    box: list[float] | None
    score: float
    kind: str | None


def _csv_columns(header: str, name: str, at: int) -> dict[str, int]:
    """Place of each column, by name."""
    columns = _fields(header, name, at)
    missing = [column for column in _COLUMNS if column not in columns]
    if missing:
        raise DataError(
            f"the first line must be a scan as JSON or a header of CSV; column {missing[0]} is missing",
            name,
            at,
        )
    known = (*_COLUMNS, _CLASS) if _CLASS in columns else _COLUMNS
    return {column: columns.index(column) for column in known}


def _csv_batches(
    place: dict[str, int], numbered: Iterator[tuple[int, bytes]], name: str, trying: _Trying
) -> Iterator[ScanBatch | None]:
    """Yield a batch of one scan for each run of rows of one sensor and time, None where a line is empty."""
    rows: list[_Row] = []
    first = 0
    for number, line in numbered:
        text = trying(decode_line, line, name, number)
        row = trying(_csv_row, text, place, name, number) if text else None
        if row is None and text != "":
            continue  # it was bad
        if rows and (row is None or (row.t, row.sensor) != (rows[0].t, rows[0].sensor)):
            yield _scan_of_rows(rows, first)
            rows = []
        if row is None:
            yield None
            continue
        first = first if rows else number
        rows.append(row)
    if rows:
        yield _scan_of_rows(rows, first)


def _fields(text: str, name: str, number: int) -> list[str]:
    try:
        return [field.strip() for field in next(csv.reader([text]))]
    except csv.Error as error:
        raise DataError(f"cannot be read as CSV: {error}", name, number) from None


def _csv_row(text: str, place: dict[str, int], name: str, number: int) -> _Row:
    fields = _fields(text, name, number)
    value = {column: fields[k] if k < len(fields) else "" for column, k in place.items()}
    if not value["sensor"]:
        raise DataError("sensor is missing", name, number)
    numbers = [column for column in _COLUMNS if column != "sensor"]
    empty = not any(value[column] for column in numbers[1:])
    found: dict[str, float] = {}
    for column in numbers[:1] if empty else numbers:
        try:
            found[column] = float(value[column])
        except ValueError:
            what = f"must be a number, got {value[column]!r}" if value[column] else "is missing"
            raise DataError(f"{column} {what}", name, number) from None
    box = None if empty else [found[column] for column in ("left", "top", "width", "height")]
    row = _Row(found["t"], value["sensor"], box, found.get("score", 0.0), value.get(_CLASS))
    try:
        _scan_of_rows([row], number)
    except DataError as error:
        raise DataError(error.message.removeprefix("box 0: "), name, number) from None
    return row


def _scan_of_rows(rows: list[_Row], line: int) -> ScanBatch:
    found = [row for row in rows if row.box is not None]
    boxes, scores = [row.box for row in found], [row.score for row in found]
    kinds = None if rows[0].kind is None else np.array([row.kind for row in found], dtype=np.str_)
    return ScanBatch([Scan(rows[0].t, rows[0].sensor, boxes, scores, kinds)], [line])  # type: ignore[arg-type]


def _joined(parts: Iterable[ScanBatch | None], name: str, ordered: bool) -> Iterator[ScanBatch]:
    """Hold scans back until a later time is seen, or an empty line of CSV; sensors in alphabetical order."""
    held: ScanBatch | None = None
    for part in parts:
        if held is None or part is None:
            if held is not None:
                yield _in_order(held)
            held = part
        elif part.t == held.t:
            held = ScanBatch(held.scans + part.scans, held.lines + part.lines)
        elif part.t > held.t:
            yield _in_order(held)
            held = part
        elif ordered:
            what = f"scan at t = {part.t} s is older than the last one at {held.t} s"
            raise DataError(what, name, part.lines[0])
        else:
            yield part
    if held is not None:
        yield _in_order(held)


def _in_order(batch: ScanBatch) -> ScanBatch:
    order = sorted(range(len(batch.scans)), key=lambda k: batch.scans[k].sensor)
    return ScanBatch([batch.scans[k] for k in order], [batch.lines[k] for k in order])
