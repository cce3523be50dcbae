"""Boxes that stand in one field, with their corners by name, as ultralytics writes them into tables."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

# `'x1': 10.5`, `"x1": 10.5` or `'x1': np.float64(10.5)`, of each corner.
_CORNER = re.compile(r"['\"]?([xy])([1-4])['\"]?\s*:\s*(?:[a-z]\w*[.(])*\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)")
#: What is read, for messages.
KNOWN = "{'x1': …, 'y1': …, 'x2': …, 'y2': …} in px"


def sides_of(value: Any) -> tuple[float, float, float, float] | None:
    """Return left, top, right, bottom (px) of a box; of one that is turned, what encloses its four corners.

    Args:
        value: a mapping of `x1, y1, x2, y2` (and `x3, y3, x4, y4`) to numbers, or one written as text.

    Returns:
        The sides; None where these are no two or four corners.
    """
    corners: dict[str, list[float]] = {"x": [], "y": []}
    try:
        if isinstance(value, Mapping):
            pairs = [(str(name)[:1], float(number)) for name, number in value.items() if number is not None]
        else:
            pairs = [(axis, float(number)) for axis, _, number in _CORNER.findall(str(value))]
        for axis, number in pairs:
            corners[axis].append(number)
    except (TypeError, ValueError, KeyError):
        return None
    x, y = corners["x"], corners["y"]
    if len(x) != len(y) or len(x) not in (2, 4):
        return None
    if len(x) == 2:
        return x[0], y[0], x[1], y[1]
    return min(x), min(y), max(x), max(y)
