"""How much boxes overlap: the one place where intersection over union (IoU) is computed.

Boxes are left, top, width, height in pixels, along the picture's axes.
"""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray


def pairwise_intersection(a: FloatArray, b: FloatArray) -> FloatArray:
    """Area that every box of `a` shares with every box of `b`: (A, B) in px².

    Args:
        a: (A, 4) left, top, width, height (px).
        b: (B, 4) the same.
    """
    first, second = a[:, None, :], b[None, :, :]
    end = np.minimum(first[..., :2] + first[..., 2:], second[..., :2] + second[..., 2:])
    side = np.maximum(end - np.maximum(first[..., :2], second[..., :2]), 0.0)
    return np.asarray(side[..., 0] * side[..., 1])


def pairwise_iou(a: FloatArray, b: FloatArray) -> FloatArray:
    """Intersection over union of every box of `a` with every box of `b`.

    Args:
        a: (A, 4) left, top, width, height (px).
        b: (B, 4) the same.

    Returns:
        (A, B) values in [0, 1]; 0 where both boxes are without area.
    """
    common = pairwise_intersection(a, b)
    union = (a[:, 2] * a[:, 3])[:, None] + (b[:, 2] * b[:, 3])[None] - common
    return np.divide(common, union, out=np.zeros_like(common), where=common > 0.0)


def pairwise_covered(a: FloatArray, b: FloatArray) -> FloatArray:
    """Share of the area of each box of `a` that lies on each box of `b`: (A, B) in [0, 1].

    Args:
        a: (A, 4) left, top, width, height (px).
        b: (B, 4) the same.
    """
    common = pairwise_intersection(a, b)
    area = np.broadcast_to((a[:, 2] * a[:, 3])[:, None], common.shape)
    return np.divide(common, area, out=np.zeros_like(common), where=area > 0.0)
