"""Times and boxes of a file's table, by whichever of their names its columns go."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.column_names import BOX, TIME_COLUMNS, sides_to_boxes, standing_in
from jeat_graph.data.errors import DataError
from jeat_graph.data.time_units import in_seconds
from jeat_graph.io.frames import check_rate

if TYPE_CHECKING:
    from jeat_graph.io.file_table import FileTable


def times_of(table: FileTable, unit: str, rate_hz: float | None) -> FloatArray:
    """Return the times (R,) of a table's rows (s): from `t`, `t_ms` and so on, or frames by their rate.

    Args:
        table: with one of these columns.
        unit: of the column `t`; `s` also where nobody said anything.
        rate_hz: frames per second; frame k is at k / rate.

    Raises:
        DataError: the first row without a time; frames without a rate; or a column that names another unit.
    """
    name = standing_in(table.names, ["t"])[0]
    if name in TIME_COLUMNS:
        if unit not in ("s", TIME_COLUMNS[name]):
            raise DataError(
                f"column {name!r} is in {TIME_COLUMNS[name]}, but --time-unit says {unit}; leave it out",
                table.path,
            )
        return in_seconds(table.number(name), TIME_COLUMNS[name])
    if name != "frame":
        return in_seconds(table.number(name), unit)
    if rate_hz is None:
        raise DataError("has frame numbers only; give their rate with --rate (in Python rate_hz)", table.path)
    return np.asarray(table.whole("frame") / check_rate(rate_hz, table.path))


def boxes_of(table: FileTable) -> FloatArray:
    """Return the boxes (R, 4) left, top, width, height (px) of a table's rows, NaN where a field is blank.

    Raises:
        DataError: names the first line or row with something that is no finite number.
    """
    names = standing_in(table.names, BOX)
    boxes = np.empty((len(table), 4))
    for k, name in enumerate(names):
        boxes[:, k] = table.number(name, blank_ok=True)
    return sides_to_boxes(names, boxes)
