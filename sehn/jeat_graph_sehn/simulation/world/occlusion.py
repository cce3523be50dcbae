"""Computes how much of each box nearer boxes cover."""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray


def visible_fraction(boxes: FloatArray, distance: FloatArray, frame: IntArray) -> FloatArray:
    """Fraction of each box that no nearer box of the same frame covers.

    Args:
        boxes: (N, 4) left, top, right, bottom (px).
        distance: (N,) from the camera; the nearer box covers the farther one.
        frame: (N,) frame of each box, not decreasing.

    Returns:
        (N,) between 0 (hidden) and 1 (free); 0 for boxes without area.
    """
    order = np.lexsort((distance, frame))
    out = np.empty(len(boxes))
    out[order] = _visible(np.ascontiguousarray(boxes[order]), np.ascontiguousarray(frame[order]))
    return out


@njit(cache=True, error_model="numpy")
def _visible(boxes: FloatArray, frame: IntArray) -> FloatArray:
    """Visible fraction of boxes sorted by frame, then from near to far."""
    n = len(boxes)
    out = np.zeros(n)
    first = 0
    for i in range(n):
        if frame[i] != frame[first]:
            first = i
        left, top, right, bottom = boxes[i]
        area = (right - left) * (bottom - top)
        if right <= left or bottom <= top:
            continue
        cover = np.empty((i - first, 4))
        count = 0
        for j in range(first, i):
            x0, y0 = max(left, boxes[j, 0]), max(top, boxes[j, 1])
            x1, y1 = min(right, boxes[j, 2]), min(bottom, boxes[j, 3])
            if x1 > x0 and y1 > y0:
                cover[count, 0], cover[count, 1], cover[count, 2], cover[count, 3] = x0, y0, x1, y1
                count += 1
        if count == 0:
            out[i] = 1.0
            continue
        cover = cover[:count]
        cover = cover[np.argsort(cover[:, 1])]
        edges = np.sort(np.concatenate((cover[:, 0], cover[:, 2])))
        covered = 0.0
        # Between two neighbouring vertical edges, what is covered is a union of intervals in y.
        for k in range(len(edges) - 1):
            if edges[k + 1] == edges[k]:
                continue
            middle = (edges[k] + edges[k + 1]) / 2.0
            length, reach = 0.0, -np.inf
            for c in range(count):
                if cover[c, 0] < middle < cover[c, 2] and cover[c, 3] > reach:
                    length += cover[c, 3] - max(cover[c, 1], reach)
                    reach = cover[c, 3]
            covered += length * (edges[k + 1] - edges[k])
        out[i] = max(0.0, 1.0 - covered / area)
    return out
