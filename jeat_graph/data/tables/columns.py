"""Times, boxes, classes and videos of a table, by whichever of their names its columns go."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray, TextArray
from jeat_graph.data.box_text import KNOWN, sides_of
from jeat_graph.data.class_columns import CLASS_COLUMNS, declared_classes, name_classes
from jeat_graph.data.column_names import (
    BOX,
    BOX_TEXT,
    FRAME_COLUMNS,
    TIME_COLUMNS,
    sides_to_boxes,
    standing_in,
)
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_numbers import FrameCount, first_frame, split_picture_name
from jeat_graph.data.tables.frame_filling import check_rate
from jeat_graph.data.tables.reading import Reading
from jeat_graph.data.tables.spreadsheets import is_number
from jeat_graph.data.time_units import in_seconds
from jeat_graph.data.videos import choose_video

if TYPE_CHECKING:
    from jeat_graph.data.tables.file_table import FileTable


@dataclass(frozen=True, eq=False)
class Times:
    """When the rows of a table are.

    Attributes:
        t: (R,) s.
        frames: (R,) frame numbers that the times are made of, or None.
        first: number of the first frame, or None.
    """

    t: FloatArray
    frames: IntArray | None = None
    first: int | None = None

    @property
    def count(self) -> FrameCount | None:
        """The frame numbers, and the first; None where the rows have times."""
        if self.frames is None or self.first is None:
            return None
        return FrameCount.of(self.frames, self.first, usual=0)


def of_one_video(table: FileTable, how: Reading) -> FileTable:
    """Return the rows of one video, where the table tells videos apart: by a column, or by pictures' names.

    Raises:
        DataError: there are several and none is chosen, or the one chosen is not there.
    """
    if "video" in table:
        names, index = table.words("video", blank_ok=True)
    elif standing_in(table.names, ["t"])[0] in FRAME_COLUMNS:
        labels = _picture_names(table, standing_in(table.names, ["t"])[0])
        if labels is None:
            return table
        distinct, index = np.unique(np.array(labels[0], dtype=np.str_), return_inverse=True)
        names, index = distinct.tolist(), index.reshape(-1)
    else:
        return table
    chosen = choose_video([name or "(no name)" for name in names], how.video, table.path)
    if chosen is None or len(names) == 1:
        return table
    return table.take(np.flatnonzero(index == [name or "(no name)" for name in names].index(chosen)))


def times_of(table: FileTable, how: Reading) -> Times:
    """Return the times of a table's rows: from `t`, `t_ms` and so on, or from frames by their rate.

    Args:
        table: with one of these columns.
        how: unit of `t`, rate and first frame.

    Raises:
        DataError: the first row without a time; frames without a rate; or a column that names another unit.
    """
    name, unit = standing_in(table.names, ["t"])[0], how.time_unit
    if name in TIME_COLUMNS:
        if unit not in ("s", TIME_COLUMNS[name]):
            raise _another_unit(table, f"column {name!r} is in {TIME_COLUMNS[name]}", unit)
        return Times(in_seconds(table.number(name), TIME_COLUMNS[name]))
    if name not in FRAME_COLUMNS:
        numbers, seconds = table.times(name, how.rate_hz)
        if seconds and unit != "s":
            raise _another_unit(table, f"column {name!r} holds dates", unit)
        return Times(numbers if seconds else in_seconds(numbers, unit))
    frames = _frame_numbers(table, name)
    first = first_frame(frames, how.first_frame)
    if len(frames) and frames.min() < first:
        row = int(np.argmin(frames >= first))
        raise table.error(row, f"frames count from {first}, got {frames[row]}")
    if how.rate_hz is None:
        if len(frames):
            raise DataError(
                "has frame numbers only; give their rate with --rate (in Python rate_hz)", table.path
            )
        return Times(np.zeros(0), frames, first)
    return Times(np.asarray((frames - first) / check_rate(how.rate_hz, table.path)), frames, first)


def boxes_of(table: FileTable) -> FloatArray:
    """Return the boxes (R, 4) left, top, width, height (px) of a table's rows, NaN where a field is blank.

    Raises:
        DataError: names the first line or row with something that is no finite number.
    """
    names = standing_in(table.names, BOX)
    boxes = np.empty((len(table), 4))
    if BOX_TEXT in names:
        for row, value in enumerate(table.values(BOX_TEXT)):
            sides = None if value is None else sides_of(value)
            if value is not None and (sides is None or not np.isfinite(sides).all()):
                raise table.error(row, f"box must be {KNOWN}, got {str(value)[:40]!r}")
            boxes[row] = np.nan if sides is None else sides
        return sides_to_boxes(("left", "top", "right", "bottom"), boxes)
    for k, name in enumerate(names):
        boxes[:, k] = table.number(name, blank_ok=True)
    return sides_to_boxes(names, boxes)


def classes_of(table: FileTable, names: Mapping[int, str] | None) -> TextArray | None:
    """Return the classes (R,) of a table's rows, empty where unknown; None where no row has one.

    Args:
        table: maybe with columns that say classes.
        names: of classes by number, for a table that numbers them; or None.
    """
    found = {name: table.text(name, blank_ok=True) for name in CLASS_COLUMNS if name in table}
    classes = declared_classes(found)
    if classes is None or not (classes != "").any():
        return None
    return name_classes(classes, names)


def _another_unit(table: FileTable, found: str, unit: str) -> DataError:
    """The error of times that have a unit themselves, and get another one from the user."""
    option = "time_unit" if table.path is None else "--time-unit"
    return DataError(f"{found}, but {option} says {unit}; leave it out", table.path)


def _frame_numbers(table: FileTable, name: str) -> IntArray:
    """Frame numbers (R,) of a column of numbers, or of pictures' names."""
    labels = _picture_names(table, name)
    if labels is None:
        return table.whole(name)
    return np.array(labels[1], dtype=np.int64)


def _picture_names(table: FileTable, name: str) -> tuple[list[str], list[int]] | None:
    """What the pictures' names (R,) share and their numbers (R,); None where the column holds numbers."""
    try:
        table.whole(name)
    except DataError:
        texts = [] if table.blank(name).any() else table.values(name)
        if any(isinstance(text, str) and is_number(text) for text in texts):
            raise  # numbers, but not all of them whole
        found = [split_picture_name(text) if isinstance(text, str) else None for text in texts]
        there = [one for one in found if one is not None]
        if not there or len(there) < len(found):
            raise
        return [label for label, _ in there], [number for _, number in there]
    return None
