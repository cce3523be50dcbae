"""Files of what somebody has drawn in a picture: lines and zones to count at, lanes, and masks.

One file may hold all of them: `lines: {name: [x1, y1, x2, y2]}`, `zones: {name: [[x, y], …]}` and
`masks: {name: [[x, y], …]}` in px, and `lanes: {name: [left, right]}` in m across the road. Whoever reads it
takes what is theirs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from jeat_graph.config.yaml_text import load_yaml
from jeat_graph.data.errors import DataError
from jeat_graph.io.tables.csv_text import read_text

Polygon = tuple[tuple[float, float], ...]
LINES, ZONES, LANES, MASKS = "lines", "zones", "lanes", "masks"
_FORMS = {
    LINES: "{name: [x1, y1, x2, y2]}",
    ZONES: "{name: [[x, y], …]}",
    LANES: "{name: [left, right]}",
    MASKS: "{name: [[x, y], …]}",
}
#: No place in a picture or on a road is farther (px, m).
_LARGEST = 1e15
_CORNERS = 3


class PictureMarks(NamedTuple):
    """What somebody drew.

    Attributes:
        lines: x1, y1, x2, y2 (px) by name.
        zones: corners x, y (px) by name.
        lanes: left and right edge (m across the road) by name.
        masks: corners x, y (px) by name.
    """

    lines: dict[str, tuple[float, float, float, float]]
    zones: dict[str, Polygon]
    lanes: dict[str, tuple[float, float]]
    masks: dict[str, Polygon]


def read_marks_file(path: str | Path, wanted: Sequence[str]) -> PictureMarks:
    """Read a file of marks.

    Args:
        path: the file.
        wanted: keys of which it must hold one at least.

    Raises:
        DataError: names the key that is unknown or holds something else.
    """
    try:
        tree = load_yaml(read_text(path).decode("utf-8", errors="replace"))
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = None if mark is None else mark.line + 1
        problem = getattr(error, "problem", None) or error
        raise DataError(f"is not valid YAML: {problem}", path, line) from None
    if not isinstance(tree, Mapping) or not set(tree) <= set(_FORMS) or not set(tree) & set(wanted):
        must = " or ".join(f"{key}: {_FORMS[key]}" for key in wanted)
        others = ", ".join(key for key in _FORMS if key not in wanted)
        raise DataError(f"must hold {must}; it may hold {others} besides", path)
    lines, lanes = (_rows(tree.get(key) or {}, n, key, path) for key, n in ((LINES, 4), (LANES, 2)))
    for name, (x1, y1, x2, y2) in lines.items():
        if (x1, y1) == (x2, y2):
            raise DataError(f"lines: {name}: both ends are the same point", path)
    for name, (left, right) in lanes.items():
        if not left < right:
            raise DataError(f"lanes: {name}: the left edge must be less than the right one", path)
    zones, masks = (_polygons(tree.get(key) or {}, key, path) for key in (ZONES, MASKS))
    return PictureMarks(lines, zones, lanes, masks)


def polygon_of(numbers: Sequence[Any], where: str, path: str | Path | None = None) -> Polygon:
    """Check corners [[x, y], …], or x, y, x, y, … in one list.

    Raises:
        DataError: names `where`, and what is wrong.
    """
    flat = [value for one in numbers for value in (one if isinstance(one, list | tuple) else [one])]
    pairs = all(len(one) == len("xy") for one in numbers if isinstance(one, list | tuple))
    if not pairs or len(flat) % 2 or len(flat) < 2 * _CORNERS or not all(map(_is_number, flat)):
        raise DataError(f"{where}: must be {_CORNERS} corners or more, each x and y in px", path)
    return tuple((float(x), float(y)) for x, y in zip(flat[::2], flat[1::2], strict=True))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= _LARGEST


def _polygons(given: Any, key: str, path: str | Path) -> dict[str, Polygon]:
    return {
        str(name): polygon_of(corners if isinstance(corners, list) else [], f"{key}: {name}", path)
        for name, corners in _named(given, key, path).items()
    }


def _rows(given: Any, count: int, key: str, path: str | Path) -> dict[str, Any]:
    rows = {}
    for name, values in _named(given, key, path).items():
        if not isinstance(values, list) or len(values) != count or not all(map(_is_number, values)):
            raise DataError(f"{key}: {name}: must be {count} numbers, got {str(values)[:80]}", path)
        rows[str(name)] = tuple(float(v) for v in values)
    return rows


def _named(given: Any, key: str, path: str | Path) -> Mapping[Any, Any]:
    if not isinstance(given, Mapping):
        raise DataError(f"{key} must name each of them, such as {key}: {{first: [...]}}", path)
    return given
