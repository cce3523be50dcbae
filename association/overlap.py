"""How much boxes overlap: the one place where intersection over union (IoU) is computed.

Boxes are left, top, width, height in pixels, along the picture's axes.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray


@njit(cache=True)
def intersection(a: FloatArray, b: FloatArray) -> float:
    """Area that two boxes share (px²).

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
    return float(width * height)


@njit(cache=True)
def overlap(a: FloatArray, b: FloatArray) -> float:
    """Intersection over union of two boxes, 0 where both are without area.

    Args:
        a: (4,) left, top, width, height (px).
        b: (4,) the same.
    """
    common = intersection(a, b)
    if common == 0.0:
        return 0.0
    return float(common / (a[2] * a[3] + b[2] * b[3] - common))


@njit(cache=True)
def _all_overlaps(a: FloatArray, b: FloatArray) -> FloatArray:
    out = np.empty((len(a), len(b)))
    for i in range(len(a)):
        for j in range(len(b)):
            out[i, j] = overlap(a[i], b[j])
    return out


@njit(cache=True)
def _all_covered(a: FloatArray, b: FloatArray) -> FloatArray:
    out = np.zeros((len(a), len(b)))
    for i in range(len(a)):
        area = a[i, 2] * a[i, 3]
        if area > 0.0:
            for j in range(len(b)):
                out[i, j] = intersection(a[i], b[j]) / area
    return out


def pairwise_iou(a: FloatArray, b: FloatArray) -> FloatArray:
    """Intersection over union of every box of `a` with every box of `b`.

    Args:
        a: (A, 4) left, top, width, height (px).
        b: (B, 4) the same.

    Returns:
        (A, B) values in [0, 1]; 0 where both boxes are without area.
    """
    return np.asarray(_all_overlaps(_rows(a), _rows(b)))


def pairwise_covered(a: FloatArray, b: FloatArray) -> FloatArray:
    """Share of the area of each box of `a` that lies on each box of `b`: (A, B) in [0, 1].

    Args:
        a: (A, 4) left, top, width, height (px).
        b: (B, 4) the same.
    """
    return np.asarray(_all_covered(_rows(a), _rows(b)))


def _rows(boxes: FloatArray) -> FloatArray:
    return np.ascontiguousarray(boxes, dtype=np.float64)
