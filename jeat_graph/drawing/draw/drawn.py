"""What was drawn on the page, checked and written as the files that the commands read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from jeat_graph.data.errors import DataError
from jeat_graph.io.files.atomic import open_atomic
from jeat_graph.io.tables.marks import LANES, LINES, MASKS, ZONES, polygon_of, read_marks_file

LENGTHS = "lengths"
_COLUMNS = ("x1", "y1", "x2", "y2", "metres", "direction")
_DIRECTIONS = ("along", "across")
_MOST_MARKS, _LONGEST_NAME = 1000, 100

Page = dict[str, list[dict[str, Any]]]


def as_page(marks: Path, lengths: Path) -> Page:
    """Return what the files hold as the page takes it; nothing where they are not there.

    Raises:
        DataError: a file is there and cannot be read.
    """
    page: Page = {LINES: [], ZONES: [], MASKS: [], LENGTHS: []}
    if marks.is_file():
        known = read_marks_file(marks, (LINES, ZONES, LANES, MASKS))
        for name, (x1, y1, x2, y2) in known.lines.items():
            page[LINES].append({"name": name, "points": [[x1, y1], [x2, y2]]})
        for key, polygons in ((ZONES, known.zones), (MASKS, known.masks)):
            page[key] = [{"name": name, "points": list(map(list, one))} for name, one in polygons.items()]
    if lengths.is_file():
        from jeat_graph.io.tables.file_tables import read_table

        table = read_table(lengths, _COLUMNS)
        numbers = zip(*(table.number(name).tolist() for name in _COLUMNS[:-1]), strict=True)
        for k, ((x1, y1, x2, y2, metres), way) in enumerate(
            zip(numbers, table.text("direction").tolist(), strict=True), 1
        ):
            row = {"name": f"length-{k}", "points": [[x1, y1], [x2, y2]]}
            page[LENGTHS].append(row | {"metres": f"{metres:g}", "direction": way})
    return page


def save_page(page: Any, marks: Path, lengths: Path) -> str:
    """Write what was drawn, and return a line that says so.

    Args:
        page: what the page sent.
        marks: the file of lines, zones and masks; its lanes stay.
        lengths: the file of lengths.

    Raises:
        DataError: it is not what a page sends, two have one name, or a length has no metres.
    """
    rows = _checked(page)
    tree: dict[str, Any] = {}
    for key in (LINES, ZONES, MASKS):
        named = _by_name(key, rows[key])
        if key == LINES:
            flat = {name: [value for point in points for value in point] for name, points in named.items()}
            tree |= {key: flat} if flat else {}
        elif named:
            tree[key] = named
    table = [_length(row) for row in rows[LENGTHS]]
    if marks.is_file():
        lanes = read_marks_file(marks, (LINES, ZONES, LANES, MASKS)).lanes
        tree |= {LANES: {name: list(edges) for name, edges in lanes.items()}} if lanes else {}
    written = []
    if tree:
        with open_atomic(marks) as file:
            yaml.safe_dump(tree, file, default_flow_style=None, sort_keys=False, allow_unicode=True)
        written.append(str(marks))
    if table:
        with open_atomic(lengths) as file:
            file.write("\n".join([",".join(_COLUMNS), *table]) + "\n")
        written.append(str(lengths))
    emptied = [path for path, there in ((marks, tree), (lengths, table)) if not there and path.is_file()]
    for path in emptied:
        path.unlink()
    sentences = [f"Saved {' and '.join(written)}."] if written else []
    sentences += [f"Removed {path}: nothing is drawn for it." for path in emptied]
    return " ".join(sentences) or "Nothing is drawn: nothing is saved."


def _checked(page: Any) -> Page:
    wrong = DataError("this is not what the page sends")
    if not isinstance(page, dict) or set(page) != {LINES, ZONES, MASKS, LENGTHS}:
        raise wrong
    for rows in page.values():
        if not isinstance(rows, list) or len(rows) > _MOST_MARKS:
            raise wrong
        if not all(isinstance(row, dict) and isinstance(row.get("points"), list) for row in rows):
            raise wrong
    return page


def _by_name(key: str, rows: list[dict[str, Any]]) -> dict[str, list[list[float]]]:
    found: dict[str, list[list[float]]] = {}
    for row in rows:
        name = str(row.get("name", "")).strip()
        if not name or len(name) > _LONGEST_NAME or not name.isprintable():
            raise DataError(f"{key}: each needs a name")
        if name in found:
            raise DataError(f"{key}: {name} is the name of two")
        found[name] = _points(row, f"{key}: {name}", 2 if key == LINES else 0)
    return found


def _points(row: dict[str, Any], where: str, count: int) -> list[list[float]]:
    """Return the corners of a mark: `count` of them, or three and more where it is 0."""
    corners = row["points"]
    if count and len(corners) != count:
        raise DataError(f"{where}: needs {count} points")
    # Two points are no polygon; with the first once more they are checked as one.
    checked = polygon_of([*corners, corners[0]] if count else corners, where)
    points = [list(point) for point in checked[: len(corners)]]
    if count and points[0] == points[1]:
        raise DataError(f"{where}: both ends are the same point")
    return points


def _length(row: dict[str, Any]) -> str:
    try:
        metres = float(str(row.get("metres", "")).replace(",", "."))
    except ValueError:
        raise DataError("each length needs its metres") from None
    if not 0.0 < metres < float("inf") or row.get("direction") not in _DIRECTIONS:
        raise DataError("each length needs metres above 0, along or across the road")
    (x1, y1), (x2, y2) = _points(row, "length", 2)
    return ",".join([*(f"{value:g}" for value in (x1, y1, x2, y2, metres)), str(row["direction"])])
