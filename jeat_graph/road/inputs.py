"""Files that the road commands read: lengths, surveyed points, lines and lanes, and tables of points."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.io.tables.file_tables import read_table
from jeat_graph.io.tables.marks import LANES, LINES, read_marks_file
from jeat_graph.road.evidence import Lengths, Points


class PointTable(NamedTuple):
    """Points of vehicles in the picture, sorted by track and time.

    Attributes:
        t: (N,) time (s).
        track_id: (N,) identity.
        pixels: (N, 2) px.
    """

    t: FloatArray
    track_id: IntArray
    pixels: FloatArray

    def tracks(self) -> list[slice]:
        """The rows of each track, in the order of their identities."""
        if not len(self.t):
            return []
        start = np.flatnonzero(np.r_[True, self.track_id[1:] != self.track_id[:-1]])
        return [slice(int(a), int(b)) for a, b in zip(start, np.r_[start[1:], len(self.t)], strict=True)]


def read_points_table(path: str | Path) -> PointTable:
    """Read a table with `t, track_id, x, y` (CSV, also gzipped, or Parquet), in any order of rows.

    Raises:
        DataError: names the file, the line and what is wrong, such as a track twice at one time.
    """
    table = read_table(path, ("t", "track_id", "x", "y"))
    t, ids = table.number("t"), table.whole("track_id")
    pixels = np.stack([table.number("x"), table.number("y")], axis=1)
    order = np.lexsort((t, ids))
    t, ids, pixels = t[order], ids[order], pixels[order]
    twice = np.flatnonzero((ids[1:] == ids[:-1]) & (t[1:] == t[:-1]))
    if len(twice):
        raise table.error(
            int(order[twice[0] + 1]), f"track {ids[twice[0]]} is there twice at t = {t[twice[0]]:g}"
        )
    return PointTable(t, ids, pixels)


def read_lengths(path: str | Path) -> Lengths:
    """Read `x1, y1, x2, y2, metres, direction` (px, m, `along` or `across`).

    Raises:
        DataError: names the line of a length that is not positive, of no extent, or of another direction.
    """
    table = read_table(path, ("x1", "y1", "x2", "y2", "metres", "direction"))
    start = np.stack([table.number("x1"), table.number("y1")], axis=1)
    end = np.stack([table.number("x2"), table.number("y2")], axis=1)
    metres, direction = table.number("metres"), table.text("direction")
    if not len(table):
        raise DataError("has no lengths", path)
    for row in np.flatnonzero(~np.isin(direction, ("along", "across"))):
        raise table.error(int(row), f"direction must be along or across, got {direction[row]!r}")
    for row in np.flatnonzero(~(metres > 0)):
        raise table.error(int(row), f"metres must be positive, got {metres[row]:g}")
    for row in np.flatnonzero((start == end).all(axis=1)):
        raise table.error(int(row), "both ends are the same point")
    return Lengths(start, end, metres, np.asarray(direction == "along"))


def read_surveyed_points(path: str | Path) -> Points:
    """Read `x, y, east, north` (px, m), at least four points.

    Raises:
        DataError: names the line and what is wrong.
    """
    table = read_table(path, ("x", "y", "east", "north"))
    pixels = np.stack([table.number("x"), table.number("y")], axis=1)
    places = np.stack([table.number("east"), table.number("north")], axis=1)
    if len(table) < 4:
        raise DataError(f"has {len(table)} points; a camera's pose needs at least 4", path)
    return Points(pixels, places)


class RoadMarks(NamedTuple):
    """What somebody drew for the road.

    Attributes:
        lines: x1, y1, x2, y2 (px) by name.
        lanes: left and right edge (m across the road) by name, or empty.
    """

    lines: dict[str, tuple[float, float, float, float]]
    lanes: dict[str, tuple[float, float]]


def read_marks(path: str | Path) -> RoadMarks:
    """Read lines and lanes of a file of marks (`io.tables.marks`).

    Raises:
        DataError: names the key that is unknown or has other than finite numbers.
    """
    marks = read_marks_file(path, (LINES, LANES))
    return RoadMarks(marks.lines, marks.lanes)
