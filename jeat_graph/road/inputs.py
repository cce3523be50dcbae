"""Files that the road commands read: lengths, surveyed points, lines and lanes, and tables of points."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from jeat_graph.config.yaml_text import load_yaml
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.io.csv_text import read_text
from jeat_graph.io.tables import read_table
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


# No place in a picture or on a road is farther (px, m).
_LARGEST = 1e15


class RoadMarks(NamedTuple):
    """What somebody drew for the road.

    Attributes:
        lines: x1, y1, x2, y2 (px) by name.
        lanes: left and right edge (m across the road) by name, or empty.
    """

    lines: dict[str, tuple[float, float, float, float]]
    lanes: dict[str, tuple[float, float]]


def read_marks(path: str | Path) -> RoadMarks:
    """Read `lines: {name: [x1, y1, x2, y2]}` in px and, if given, `lanes: {name: [left, right]}` in m.

    Raises:
        DataError: names the key that is unknown or has other than finite numbers.
    """
    try:
        tree = load_yaml(read_text(path).decode("utf-8", errors="replace"))
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = None if mark is None else mark.line + 1
        problem = getattr(error, "problem", None) or error
        raise DataError(f"is not valid YAML: {problem}", path, line) from None
    if not isinstance(tree, Mapping) or not set(tree) <= {"lines", "lanes"} or not tree:
        raise DataError(
            "must hold lines: {name: [x1, y1, x2, y2]}, and may hold lanes: {name: [left, right]}", path
        )
    lines, lanes = (_rows(tree.get(key) or {}, n, key, path) for key, n in (("lines", 4), ("lanes", 2)))
    for name, (x1, y1, x2, y2) in lines.items():
        if (x1, y1) == (x2, y2):
            raise DataError(f"lines: {name}: both ends are the same point", path)
    for name, (left, right) in lanes.items():
        if not left < right:
            raise DataError(f"lanes: {name}: the left edge must be less than the right one", path)
    return RoadMarks(lines, lanes)


def _rows(given: Any, count: int, key: str, path: str | Path) -> dict[str, Any]:
    if not isinstance(given, Mapping):
        raise DataError(f"{key} must name each of them, such as {key}: {{first: [...]}}", path)
    rows = {}
    for name, values in given.items():
        good = isinstance(values, list) and len(values) == count
        if not good or not all(
            isinstance(v, int | float) and not isinstance(v, bool) and abs(v) <= _LARGEST for v in values
        ):
            raise DataError(f"{key}: {name}: must be {count} numbers, got {str(values)[:80]}", path)
        rows[str(name)] = tuple(float(v) for v in values)
    return rows
