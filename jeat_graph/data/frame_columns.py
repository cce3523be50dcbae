"""Columns of data frames (pandas, polars, Arrow), by the names that files may have for them too."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, TextArray
from jeat_graph.data.box_std import STD_COLUMNS, known_std
from jeat_graph.data.box_text import KNOWN, sides_of
from jeat_graph.data.boxes import class_texts
from jeat_graph.data.class_columns import CLASS_COLUMNS, declared_classes
from jeat_graph.data.column_names import BOX, BOX_TEXT, sides_to_boxes, standing_in, usual_names
from jeat_graph.data.errors import DataError

#: Columns that say classes, and which video a row is of.
ASIDE = (*CLASS_COLUMNS, "video")
#: The message where a box is missing; `x` and `y` alone may be a corner or the centre.
KNOWN_BOXES = (
    "known are left, top, width, height, or x1, y1 and cx, cy for the place, w, h and right, bottom or "
    "x2, y2 for the size (all names: docs/reference/formats.md)"
)


def collected(source: Any) -> Any:
    """Return a polars LazyFrame as the data frame that it stands for; anything else as it is."""
    kind = type(source)
    lazy = kind.__module__.partition(".")[0] == "polars" and kind.__name__ == "LazyFrame"
    return source.collect() if lazy else source


def has_columns(source: Any) -> bool:
    """Whether this is a table whose columns have names; those that are only numbered do not."""
    return hasattr(source, "columns") and any(isinstance(name, str) for name in labels_of(source))


def named_columns(table: Any, needed: Sequence[str], optional: Sequence[str], what: str) -> dict[str, Any]:
    """Return the columns of a table by the names that the readers know (`column_names`).

    Args:
        table: a data frame.
        needed: columns that must be there, or others that can stand for them.
        optional: columns that may be there.
        what: what the table is to be, for the message.

    Raises:
        DataError: a column is missing or there twice; the message says which names are known.
    """
    labels = labels_of(table)
    names = usual_names([str(label) for label in labels], [*needed, *optional])
    twice = next((name for name, count in Counter(names).items() if count > 1), None)
    if twice is not None:
        raise DataError(f"the column {twice!r} is there twice")
    missing = [name for name in standing_in(names, needed) if name not in names]
    if missing:
        known = f"; {KNOWN_BOXES}" if missing[0] in BOX else ""
        there = ", ".join(str(label) for label in labels)
        raise DataError(f"{what} need the column {missing[0]}; the table has {there}{known}")
    return {name: table[label] for name, label in zip(names, labels, strict=True)}


def boxes_of_columns(columns: Mapping[str, Any]) -> FloatArray:
    """Return boxes (M, 4) left, top, width, height (px) of columns from `named_columns`.

    Raises:
        DataError: a column that does not hold numbers.
    """
    names = standing_in(list(columns), BOX)
    if BOX_TEXT in names:
        return _boxes_in_one_field(columns[BOX_TEXT])
    return sides_to_boxes(names, np.column_stack([numbers_of(columns[name], name) for name in names]))


class DetectorColumns(NamedTuple):
    """One picture's table: boxes (M, 4); and scores (M,), classes (M,), `box_std` (M, 4) as far as there."""

    boxes: FloatArray
    scores: FloatArray | None
    classes: TextArray | None
    box_std: FloatArray | None


def detector_columns(table: Any) -> DetectorColumns:
    """Return what one picture's table says.

    Raises:
        DataError: as `named_columns` and `boxes_of_columns`.
    """
    columns = named_columns(table, BOX, ("score", *CLASS_COLUMNS, *STD_COLUMNS), "boxes")
    boxes = boxes_of_columns(columns)
    scores = numbers_of(columns["score"], "score") if "score" in columns else None
    std = np.full((len(boxes), 4), np.nan)
    for side, name in enumerate(STD_COLUMNS):
        if name in columns:
            std[:, side] = numbers_of(columns[name], name)
    return DetectorColumns(boxes, scores, classes_of_columns(columns, len(boxes)), known_std(std))


def classes_of_columns(columns: Mapping[str, Any], count: int) -> TextArray | None:
    """Return classes (R,) of columns from `named_columns`: names before numbers; None without any."""
    found = {name: class_texts(columns[name], count) for name in CLASS_COLUMNS if name in columns}
    return declared_classes(found)


def _boxes_in_one_field(column: Any) -> FloatArray:
    """Boxes (M, 4) of a column of corners by name; NaN where there is none."""
    boxes = np.full((len(column), 4), np.nan)
    for row, value in enumerate(column):
        if value is None or value != value:
            continue
        sides = sides_of(value)
        if sides is None:
            raise DataError(f"row {row}: box must be {KNOWN}, not {str(value)[:40]!r}")
        boxes[row] = sides
    return sides_to_boxes(("left", "top", "right", "bottom"), boxes)


def numbers_of(column: Any, name: str, what: str = "numbers") -> FloatArray:
    """Return a column as numbers (N,), NaN where a table has nothing.

    Raises:
        DataError: it holds something else.
    """
    try:
        return np.array(column, dtype=np.float64)
    except (TypeError, ValueError):
        first = next((one for one in column if not isinstance(one, int | float)), None)
        raise DataError(f"column {name!r} must hold {what}, not {str(first)[:40]!r}") from None


def labels_of(table: Any) -> list[Any]:
    """Return what the columns of a data frame are called, in their order."""
    arrow = type(table).__module__.partition(".")[0] == "pyarrow"  # its `columns` are the columns themselves
    return list(table.column_names if arrow else table.columns)
