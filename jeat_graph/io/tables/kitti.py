"""KITTI tracking labels, detections and results: one object a line, frames counted from 0, 10 Hz.

Columns: frame, track id, type, truncated, occluded, alpha, box left, top, right, bottom (px), height, width,
length (m), location x, y, z in the camera's frame (m), rotation about y, and in results a score.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.tables.file_table import FileTable
from jeat_graph.io.tables.plain_text import read_plain

FIRST_FRAME = 0
RATE_HZ = 10.0
NO_OBJECT = "DontCare"
_UNKNOWN_LOCATION = -999.0  # the format writes -1000 where the location is not known
_LABEL = (
    *("frame", "id", "type", "truncated", "occluded", "alpha", "left", "top", "right", "bottom"),
    *("size_h", "size_w", "size_l", "loc_x", "loc_y", "loc_z", "rotation"),
)
_COLUMNS = {17: _LABEL, 18: (*_LABEL, "score")}


def read_lines(path: str | Path) -> FileTable:
    """Read the columns of the format, `score` only if it is there.

    Raises:
        DataError: names the first line with a wrong number of fields.
    """
    return read_plain(path, _COLUMNS, "KITTI tracking")


def boxes_of(table: FileTable) -> FloatArray:
    """Return left, top, width, height (R, 4) in px.

    Raises:
        DataError: names the first line where an edge is not a finite number.
    """
    left, top, right, bottom = (table.number(name) for name in ("left", "top", "right", "bottom"))
    return np.stack([left, top, right - left, bottom - top], axis=1)


def distances_of(table: FileTable) -> FloatArray:
    """Return the distance from the camera (R,) in m, NaN where the location is not known."""
    location = np.stack([table.number(name) for name in ("loc_x", "loc_y", "loc_z")], axis=1)
    known = (location > _UNKNOWN_LOCATION).all(axis=1)
    return np.where(known, np.linalg.norm(location, axis=1), np.nan)
