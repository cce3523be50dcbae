"""JSON of one object a box, with the columns of a table: what supervision's `JSONSink` writes.

Keys go by the names that columns of tables have (`column_names`); a key that is empty text has no value. The
frame comes from `custom_data`, such as `{"frame": k}`; frames per second too, if it says `fps`.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.box_std import STD_COLUMNS
from jeat_graph.data.class_columns import LISTS_COUNT_FROM
from jeat_graph.data.column_names import BOX, FRAME_COLUMNS, standing_in, usual_names
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_columns import ASIDE, named_columns
from jeat_graph.data.tables.columns import boxes_of, classes_of, of_one_video, times_of
from jeat_graph.data.tables.detection_table import read_std
from jeat_graph.data.tables.file_table import FileTable
from jeat_graph.data.tables.frame_filling import fill_frames
from jeat_graph.data.tables.reading import Reading
from jeat_graph.io.formats.record import BoxFormat, Certainty, FileBoxes, FileHead
from jeat_graph.io.tables.class_names import names_by_number
from jeat_graph.io.tables.csv_text import read_text

_OPTIONAL = ("score", *STD_COLUMNS, "object_id", *ASIDE)
_RATES = ("video_fps", "fps", "frame_rate")
_NO_IDENTITY = -1


class _JsonColumns:
    """Objects as a table with columns."""

    def __init__(self, rows: list[dict[str, Any]]) -> None:
        self._rows = rows
        self.columns = list(dict.fromkeys(str(key) for row in rows for key in row))

    def __getitem__(self, name: str) -> list[Any]:
        return [None if row.get(name) == "" else row.get(name) for row in self._rows]


def read_boxes(path: str | Path, how: Reading, _truth: bool = False) -> FileBoxes:
    """Read a list of objects.

    Raises:
        DataError: it is no such list; names the row (from 1) that is not as it should be.
    """
    rows = _load(path)
    table = _table(rows, Path(path))
    if how.rate_hz is None:
        how = replace(how, rate_hz=_declared_rate(rows))
    table = of_one_video(table, how)
    times = times_of(table, how)
    scores = table.number("score", blank_ok=True) if "score" in table else np.full(len(table), np.nan)
    ids = table.whole("object_id", blank_ok=True) if "object_id" in table else None
    if ids is not None:
        blank = table.blank("object_id")
        ids = None if blank.all() else np.where(blank, _NO_IDENTITY, ids)
    boxes = boxes_of(table)
    if np.isnan(boxes).any():
        raise table.error(int(np.argmax(np.isnan(boxes).any(axis=1))), "the box is missing")

    def recorded() -> FloatArray:
        if times.frames is None or times.first is None or how.rate_hz is None:
            return np.unique(times.t)
        return np.asarray((fill_frames(times.frames, path) - times.first) / how.rate_hz)

    return FileBoxes(
        t=times.t,
        boxes=boxes,
        error=table.error,
        recorded=recorded,
        scores=None if np.isnan(scores).all() else np.where(np.isnan(scores), 1.0, scores),
        box_std=read_std(table),
        ids=ids,
        classes=classes_of(table, names_by_number(how.class_names, path, LISTS_COUNT_FROM)),
        frames=times.count,
    )


def _load(path: str | Path) -> list[dict[str, Any]]:
    try:
        found = json.loads(read_text(path).decode("utf-8"))
    except json.JSONDecodeError as error:
        raise DataError(f"is not JSON: {error.msg}", path, error.lineno) from None
    except (UnicodeDecodeError, RecursionError, ValueError) as error:
        raise DataError(f"is not JSON: {str(error)[:200]}", path) from None
    if not isinstance(found, list):
        raise DataError("must be a list of objects, one a box", path)
    bad = next((k for k, row in enumerate(found) if not isinstance(row, dict)), None)
    if bad is not None:
        raise DataError(f"row {bad + 1}: must be an object with a box", path)
    return found


def _table(rows: list[dict[str, Any]], path: Path) -> FileTable:
    try:
        columns = named_columns(_JsonColumns(rows), ("t", *BOX), _OPTIONAL, "boxes")
    except DataError as error:
        more = '; JSONSink writes it with custom_data={"frame": k}' if "column t" in error.message else ""
        raise DataError(error.message + more, path) from None
    return FileTable(path, {name: _arrow(column) for name, column in columns.items()}, first_row=1)


def _arrow(values: list[Any]) -> Any:
    """Return a column as Arrow's; what is of several kinds as text."""
    import pyarrow as pa

    try:
        column = pa.array(values, from_pandas=True)
    except (pa.ArrowException, TypeError, ValueError, OverflowError):
        column = pa.array([None if one is None else str(one) for one in values], pa.string())
    return pa.chunked_array([column])


def _declared_rate(rows: list[dict[str, Any]]) -> float | None:
    """Frames per second (Hz) that all objects agree on; None where they do not."""
    for key in _RATES:
        rates = {row.get(key) for row in rows if isinstance(row.get(key), int | float)}
        if len(rates) == 1 and (rate_hz := float(next(iter(rates)) or 0.0)) > 0.0:
            return rate_hz
    return None


def _first_names(text: str) -> list[str]:
    """Keys of the first object by the names that readers know; none where there is no object."""
    start = text.find("{")
    if not text.startswith("[") or start < 0:
        return []
    try:
        first, _ = json.JSONDecoder().raw_decode(text[start:])
    except ValueError:
        return []
    return usual_names(list(first), ("t", *BOX, *_OPTIONAL)) if isinstance(first, dict) else []


def _recognise(head: FileHead) -> Certainty:
    """A list whose first object has the sides of a box under keys of their own."""
    names = _first_names(head.text)
    return Certainty.SAYS if set(standing_in(names, BOX)) <= set(names) else Certainty.NONE


def _counts_frames(path: str | Path) -> bool:
    return (
        standing_in(_first_names(read_text(path).decode("utf-8", errors="replace")), ["t"])[0]
        in FRAME_COLUMNS
    )


FORMAT = BoxFormat(
    name="json-rows",
    title="JSON of rows",
    reads="what supervision's `JSONSink` writes: a list of one object a box, keys as columns of CSV; frames "
    "from `custom_data`, by `--rate` or what it says as `fps`",
    recognise=_recognise,
    read=read_boxes,
    counts_frames=_counts_frames,
)
