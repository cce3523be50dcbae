"""Scans from rows of CSV, as they come: one row a detection, with a header before them."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import TextArray
from jeat_graph.data.box_std import STD_COLUMNS
from jeat_graph.data.box_text import KNOWN, sides_of
from jeat_graph.data.camera_motion import CAMERA_MOTION
from jeat_graph.data.class_columns import CLASS_COLUMNS
from jeat_graph.data.column_names import (
    BOX,
    BOX_TEXT,
    DEFAULT_SENSOR,
    FRAME_COLUMNS,
    sides_to_boxes,
    standing_in,
    usual_names,
)
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_columns import ASIDE
from jeat_graph.data.notes import note
from jeat_graph.data.tables.file_table import advice_on
from jeat_graph.data.tables.spreadsheets import unguarded
from jeat_graph.io.streams.scan_batch import ScanBatch, Trying
from jeat_graph.io.streams.stream_reading import StreamReading, video_of_picture
from jeat_graph.io.streams.stream_text import decode_line
from jeat_graph.io.tables.headers import delimiter_of

_COLUMNS = ("t", "sensor", *BOX)
_OPTIONAL = ("score", *STD_COLUMNS, "embedding", CAMERA_MOTION, *ASIDE)
_CORNERS = ("left", "top", "right", "bottom")


class _Row(NamedTuple):
    t: float
    sensor: str
    box: list[float] | None
    score: float
    kinds: dict[str, str]
    embedding: list[float] | None
    motion: list[float] | None
    std: list[float] | None
    flat: int


class CsvForm(NamedTuple):
    """How the rows of a stream are written.

    Attributes:
        place: of each column that is read, by name.
        time: name of the column of times or frames.
        sides: names of the four columns of a box, as `standing_in` gives them.
        delimiter: between two fields.
    """

    place: dict[str, int]
    time: str
    sides: list[str]
    delimiter: str


def csv_columns(header: str, name: str, at: int) -> CsvForm:
    """Read a header; columns may go by the names that files may have for them, or be stood in for.

    Raises:
        DataError: a column is missing.
    """
    mark = delimiter_of(header)
    columns = usual_names(_fields(header, name, at, mark), (*_COLUMNS, *_OPTIONAL))
    twice = next((column for column, count in Counter(columns).items() if count > 1), None)
    if twice is not None:
        raise DataError(f"column {twice!r} is there twice", name, at)
    time, sides = standing_in(columns, ["t"])[0], standing_in(columns, BOX)
    needed = [time, *(() if time in FRAME_COLUMNS else ("sensor",)), *sides]
    missing = [column for column in needed if column not in columns]
    if missing:
        what = f"column {missing[0]} is missing"
        raise DataError(f"the first line must be a scan as JSON or a header of CSV; {what}", name, at)
    declared = [column for column in columns if column.startswith("sensor.")]
    if declared:
        note(
            f"{', '.join(declared)}: a stream's tracker is made before its first row: this is not read; give "
            "it with --set sensors.NAME.… or --detector-frames and its like"
        )
    known = [column for column in (*needed, "sensor", *_OPTIONAL) if column in columns]
    return CsvForm({column: columns.index(column) for column in known}, time, sides, mark)


def csv_batches(
    form: CsvForm,
    numbered: Iterator[tuple[int, bytes]],
    name: str,
    trying: Trying,
    how: StreamReading,
) -> Iterator[ScanBatch | None]:
    """Yield a batch of one scan for each run of rows of one sensor and time, None where a line is empty."""
    rows: list[_Row] = []
    first = 0
    for number, line in numbered:
        text = trying(decode_line, line, name, number)
        row = trying(_csv_row, text, form, name, number, how) if text else None
        if row is None and text != "":
            continue  # it was bad, or of another video
        if rows and (row is None or (row.t, row.sensor) != (rows[0].t, rows[0].sensor)):
            batch = trying(_scan_that_fits, rows, first, name, how)
            rows = []
            if batch is not None:
                yield batch
        if row is None:
            yield None
            continue
        first = first if rows else number
        rows.append(row)
    batch = trying(_scan_that_fits, rows, first, name, how) if rows else None
    if batch is not None:
        yield batch


def _scan_that_fits(rows: list[_Row], first: int, name: str, how: StreamReading) -> ScanBatch:
    """Make the scan of rows that are good each by itself; errors name the line of the first."""
    lengths = sorted({len(row.embedding) for row in rows if row.embedding is not None})
    if len(lengths) > 1:
        what = f"embeddings of one scan must have equally many numbers, not {lengths[0]} and {lengths[1]}"
        raise DataError(what, name, first)
    return _scan_of_rows(rows, first, how)


def _fields(text: str, name: str, number: int, delimiter: str) -> list[str]:
    try:
        return [field.strip() for field in next(csv.reader([text], delimiter=delimiter))]
    except csv.Error as error:
        raise DataError(f"cannot be read as CSV: {error}", name, number) from None


def _csv_row(text: str, form: CsvForm, name: str, number: int, how: StreamReading) -> _Row | None:
    """Read one row; None if it is of a video that is not asked for, or every field is blank."""
    fields, place = _fields(text, name, number, form.delimiter), form.place
    if not any(fields):
        return None
    value = {column: unguarded(fields[k]) if k < len(fields) else "" for column, k in place.items()}
    # Each row is checked by itself, so that its line can be named; one without area stays, as a scan.
    try:
        row = _row_of(value, form, how)
        # Of classes everything is taken: they would only cost time here.
        flat = 0 if row is None else _scan_of_rows([row._replace(kinds={})], number, how).flat
    except DataError as error:
        raise DataError(error.message.removeprefix("box 0: "), name, number) from None
    return row._replace(box=None, flat=flat) if row is not None and flat else row


def _row_of(value: dict[str, str], form: CsvForm, how: StreamReading) -> _Row | None:
    sensor = value.get("sensor", DEFAULT_SENSOR)
    if not sensor:
        raise DataError("sensor is missing")
    if not value[form.time]:
        raise DataError(f"{form.time} is missing")
    comma = form.delimiter == ";"
    time = value[form.time].replace(",", ".") if comma else value[form.time]
    video = value.get("video", video_of_picture(form.time, time))
    if video is not None and not how.takes_video(video):
        return None
    t = how.seconds(form.time, time)
    numbers = [*dict.fromkeys(form.sides), *(("score",) if "score" in value else ())]
    box, score = None, 1.0
    if any(value[column] for column in numbers):
        score = _number("score", value["score"], comma) if "score" in value else score
        box = _box_of(value, form, comma)
    words = value.get("embedding", "").split()
    embedding = [_number("embedding", word, comma) for word in words] if words and box is not None else None
    motion = [_number(CAMERA_MOTION, word, comma) for word in value.get(CAMERA_MOTION, "").split()] or None
    kinds = {name: value[name] for name in CLASS_COLUMNS if name in value}
    return _Row(t, sensor, box, score, kinds, embedding, motion, _std_of(value, comma), 0)


def _std_of(value: dict[str, str], comma: bool) -> list[float] | None:
    """Standard deviations of the sides (px) of a row, NaN where one is blank; None where it says none."""
    if not any(value.get(column) for column in STD_COLUMNS):
        return None
    texts = [value.get(column, "") for column in STD_COLUMNS]
    return [
        _number(column, text, comma) if text else np.nan
        for column, text in zip(STD_COLUMNS, texts, strict=True)
    ]


def _box_of(value: dict[str, str], form: CsvForm, comma: bool) -> list[float]:
    """Left, top, width, height (px) of a row."""
    if BOX_TEXT in form.sides:
        sides = sides_of(value[BOX_TEXT])
        if sides is None:
            raise DataError(f"box must be {KNOWN}, got {value[BOX_TEXT][:40]!r}")
        return [float(side) for side in sides_to_boxes(_CORNERS, np.array([sides]))[0]]
    found = [_number(column, value[column], comma) for column in form.sides]
    return [float(side) for side in sides_to_boxes(form.sides, np.array([found]))[0]]


def _number(column: str, text: str, comma: bool) -> float:
    try:
        return float(text.replace(",", ".") if comma else text)
    except ValueError:
        raise DataError(
            f"{column} " + (f"must be a number, got {text!r}{advice_on(text)}" if text else "is missing")
        ) from None


def _scan_of_rows(rows: list[_Row], line: int, how: StreamReading) -> ScanBatch:
    found = [row for row in rows if row.box is not None]
    boxes, scores = np.array([row.box for row in found]), [row.score for row in found]
    kinds: dict[str, TextArray] = {
        column: np.array([row.kinds[column] for row in found], dtype=np.str_) for column in rows[0].kinds
    }
    numbers = next((len(row.embedding) for row in found if row.embedding is not None), 0)
    embeddings = (
        [[np.nan] * numbers if row.embedding is None else row.embedding for row in found] if numbers else None
    )
    motion = next((row.motion for row in rows if row.motion is not None), None)
    known = any(row.std is not None for row in found)
    std = [[np.nan] * 4 if row.std is None else row.std for row in found] if known else None
    scan, flat = how.scan(rows[0].t, rows[0].sensor, boxes, scores, kinds, embeddings, motion, std)
    return ScanBatch([scan], [line], flat + sum(row.flat for row in rows))
