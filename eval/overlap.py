"""Overlap of axis-aligned boxes given as left, top, width, height."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray


def _intersection(a: FloatArray, b: FloatArray) -> FloatArray:
    """Areas common to each pair of `a` (A, 4) and `b` (B, 4): (A, B)."""
    a, b = a[:, None, :], b[None, :, :]
    width = np.minimum(a[..., 0] + a[..., 2], b[..., 0] + b[..., 2]) - np.maximum(a[..., 0], b[..., 0])
    height = np.minimum(a[..., 1] + a[..., 3], b[..., 1] + b[..., 3]) - np.maximum(a[..., 1], b[..., 1])
    area: FloatArray = np.maximum(width, 0.0) * np.maximum(height, 0.0)
    return area


def pairwise_iou(a: FloatArray, b: FloatArray) -> FloatArray:
    """Intersection over union of every box of `a` with every box of `b`.

    Args:
        a: (A, 4) left, top, width, height (px).
        b: (B, 4) the same.

    Returns:
        (A, B) values in [0, 1]; 0 where both boxes are without area.
    """
    common = _intersection(a, b)
    union = (a[:, 2] * a[:, 3])[:, None] + (b[:, 2] * b[:, 3])[None, :] - common
    return np.divide(common, union, out=np.zeros_like(common), where=union > 0.0)


def pairwise_covered(a: FloatArray, b: FloatArray) -> FloatArray:
    """Share of the area of each box of `a` that lies on each box of `b`: (A, B) in [0, 1].

    Args:
        a: (A, 4) left, top, width, height (px).
        b: (B, 4) the same.
    """
    common = _intersection(a, b)
    area = np.broadcast_to((a[:, 2] * a[:, 3])[:, None], common.shape)
    return np.divide(common, area, out=np.zeros_like(common), where=area > 0.0)
