"""Scans from rows of CSV, as they come: one row a detection, with a header before them."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from jeat_graph.data.column_names import BOX, TIME_COLUMNS, sides_to_boxes, standing_in, usual_names
from jeat_graph.data.errors import DataError
from jeat_graph.data.scan import scan_with_area
from jeat_graph.io.headers import delimiter_of
from jeat_graph.io.scan_batch import ScanBatch, Trying
from jeat_graph.io.spreadsheets import unguarded
from jeat_graph.io.stream_text import decode_line

_COLUMNS = ("t", "sensor", "left", "top", "width", "height", "score")
_CLASS = "class"  # a column that may be there


class _Row(NamedTuple):
    t: float
    sensor: str
    box: list[float] | None
    score: float
    kind: str | None
    flat: int


class CsvForm(NamedTuple):
    """How the rows of a stream are written.

    Attributes:
        place: of each column that is read, by name.
        sides: names of the four columns of a box, as `standing_in` gives them.
        delimiter: between two fields.
    """

    place: dict[str, int]
    sides: list[str]
    delimiter: str


def csv_columns(header: str, name: str, at: int) -> CsvForm:
    """Read a header; columns may go by the names that files may have for them.

    Raises:
        DataError: a column is missing.
    """
    mark = delimiter_of(header)
    columns = usual_names(_fields(header, name, at, mark), (*_COLUMNS, _CLASS))
    sides = standing_in(columns, BOX)
    needed = ["t", "sensor", *sides, "score"]
    missing = [column for column in needed if column not in columns]
    if missing:
        unit = next((TIME_COLUMNS[column] for column in columns if column in TIME_COLUMNS), None)
        hint = (
            f"; name the column of times t, and give --time-unit {unit}" if missing[0] == "t" and unit else ""
        )
        what = f"column {missing[0]} is missing{hint}"
        raise DataError(f"the first line must be a scan as JSON or a header of CSV; {what}", name, at)
    known = [*needed, _CLASS] if _CLASS in columns else needed
    return CsvForm({column: columns.index(column) for column in known}, sides, mark)


def csv_batches(
    form: CsvForm, numbered: Iterator[tuple[int, bytes]], name: str, trying: Trying
) -> Iterator[ScanBatch | None]:
    """Yield a batch of one scan for each run of rows of one sensor and time, None where a line is empty."""
    rows: list[_Row] = []
    first = 0
    for number, line in numbered:
        text = trying(decode_line, line, name, number)
        row = trying(_csv_row, text, form, name, number) if text else None
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


def _fields(text: str, name: str, number: int, delimiter: str) -> list[str]:
    try:
        return [field.strip() for field in next(csv.reader([text], delimiter=delimiter))]
    except csv.Error as error:
        raise DataError(f"cannot be read as CSV: {error}", name, number) from None


def _csv_row(text: str, form: CsvForm, name: str, number: int) -> _Row:
    fields, place = _fields(text, name, number, form.delimiter), form.place
    value = {column: unguarded(fields[k]) if k < len(fields) else "" for column, k in place.items()}
    if not value["sensor"]:
        raise DataError("sensor is missing", name, number)
    numbers = ["t", *form.sides, "score"]
    empty = not any(value[column] for column in numbers[1:])
    found: dict[str, float] = {}
    for column in numbers[:1] if empty else numbers:
        try:
            found[column] = float(value[column].replace(",", ".") if form.delimiter == ";" else value[column])
        except ValueError:
            what = f"must be a number, got {value[column]!r}" if value[column] else "is missing"
            raise DataError(f"{column} {what}", name, number) from None
    box = None
    if not empty:
        box = sides_to_boxes(form.sides, np.array([[found[column] for column in form.sides]]))[0].tolist()
    # Each row is checked by itself, so that its line can be named; one without area stays, as a look.
    row = _Row(found["t"], value["sensor"], box, found.get("score", 0.0), value.get(_CLASS), 0)
    try:
        flat = _scan_of_rows([row], number).flat
    except DataError as error:
        raise DataError(error.message.removeprefix("box 0: "), name, number) from None
    return row._replace(box=None, flat=flat) if flat else row


def _scan_of_rows(rows: list[_Row], line: int) -> ScanBatch:
    found = [row for row in rows if row.box is not None]
    boxes, scores = np.array([row.box for row in found]), [row.score for row in found]
    kinds = None if rows[0].kind is None else np.array([row.kind for row in found], dtype=np.str_)
    scan, flat = scan_with_area(rows[0].t, rows[0].sensor, boxes, scores, kinds)
    return ScanBatch([scan], [line], flat + sum(row.flat for row in rows))
