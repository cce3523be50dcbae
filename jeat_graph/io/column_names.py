"""Names that columns go by in the files people have: `confidence` for `score`, `x1, y1, x2, y2` for a box."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.views import BOX
from jeat_graph.io.frames import check_rate
from jeat_graph.io.time_units import in_seconds

if TYPE_CHECKING:
    from jeat_graph.io.file_table import FileTable

#: Usual names of each column, in lower case; not `x` and `y`, which may be a corner or the centre.
ALIASES: Mapping[str, tuple[str, ...]] = {
    "t": ("time", "timestamp", "time_s", "t_s", "timestamp_s", "seconds", "sec"),
    "t_ms": ("time_ms", "timestamp_ms"),
    "t_us": ("time_us", "timestamp_us"),
    "t_ns": ("time_ns", "timestamp_ns"),
    "frame": ("frame_id", "frame_number", "frame_index", "frame_idx", "frame_no", "frameid"),
    "sensor": ("camera", "sensor_name"),
    "left": ("x1", "xmin", "x_min", "bb_left", "bbox_left", "box_left"),
    "top": ("y1", "ymin", "y_min", "bb_top", "bbox_top", "box_top"),
    "cx": ("center_x", "centre_x", "x_center", "x_centre", "xc"),
    "cy": ("center_y", "centre_y", "y_center", "y_centre", "yc"),
    "right": ("x2", "xmax", "x_max", "bb_right", "bbox_right", "box_right"),
    "bottom": ("y2", "ymax", "y_max", "bb_bottom", "bbox_bottom", "box_bottom"),
    "width": ("w", "bb_width", "bbox_width", "box_width"),
    "height": ("h", "bb_height", "bbox_height", "box_height"),
    "score": ("conf", "confidence", "prob", "probability"),
    "class": ("class_name", "label", "category", "cls"),
    "object_id": ("objectid", "obj_id", "id", "track_id"),
}
#: Columns that may stand for `t`, with their units.
TIME_COLUMNS = {"t_ms": "ms", "t_us": "us", "t_ns": "ns"}
#: Columns of times and boxes that hold numbers, by any of their names.
NUMBER_COLUMNS = ("t", *TIME_COLUMNS, *BOX, "right", "bottom", "cx", "cy")
_STAND_INS = {
    "t": (*TIME_COLUMNS, "frame"),
    "left": ("cx",),
    "top": ("cy",),
    "width": ("right",),
    "height": ("bottom",),
}
_CANONICAL = {alias: name for name, aliases in ALIASES.items() for alias in aliases}


def usual_names(names: Sequence[str], known: Sequence[str]) -> list[str]:
    """Give columns the names that the readers know, where no other column has that name already.

    Args:
        names: as the file has them.
        known: columns that the reader asks for; an alias of any other column stays what it is.

    Returns:
        A name for each column.
    """
    out = list(names)
    known = [*known, *(name for others in _STAND_INS.values() for name in others)]
    lower = {name.lower(): name for name in known}
    # A column's own name goes before an alias, and the first alias before the second.
    for find in (lower.get, lambda text: _CANONICAL.get(text)):
        for k, name in enumerate(names):
            found = find(name.lower())
            if out[k] == name and found is not None and found in known and found not in out:
                out[k] = found
    return out


def standing_in(names: Sequence[str], wanted: Sequence[str]) -> list[str]:
    """Replace the columns that are not there by those that can stand for them: `right` for `width`.

    Args:
        names: that the file has.
        wanted: that the reader asks for.
    """
    out = []
    for name in wanted:
        there = [other for other in _STAND_INS.get(name, ()) if other in names]
        out.append(there[0] if name not in names and there else name)
    return out


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
    for k in (0, 1):
        centre = names[k] in ("cx", "cy")
        if names[k + 2] in ("right", "bottom"):
            boxes[:, k + 2] -= boxes[:, k]
            boxes[:, k + 2] *= 2.0 if centre else 1.0
        if centre:
            boxes[:, k] -= 0.5 * boxes[:, k + 2]
    return boxes
