"""Overlap of boxes given as left, top, width, height."""

from __future__ import annotations

from numba import njit

from jeat_graph.data.arrays import FloatArray


@njit(cache=True)
def overlap(a: FloatArray, b: FloatArray) -> float:
    """Intersection over union of two boxes.

    Args:
        a: (4,) left, top, width, height (px).
        b: (4,) the same.
    """
    width = min(a[0] + a[2], b[0] + b[2]) - max(a[0], b[0])
    if width <= 0.0:
        return 0.0
    height = min(a[1] + a[3], b[1] + b[3]) - max(a[1], b[1])
    if height <= 0.0:
        return 0.0
    common = width * height
    return float(common / (a[2] * a[3] + b[2] * b[3] - common))
