"""Boxes of tracks: made from their states, and how much of one lies in the picture or behind others."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray

# A runaway extrapolation of a size must not overflow: e^12 px is beyond any picture.
_MOST_LOG_SIZE = 12.0


@njit(cache=True)
def visible_fraction(box: FloatArray, width: float, height: float) -> float:
    """Fraction of a box's area that lies inside a picture of `width` x `height` px.

    Args:
        box: (4,) left, top, width, height (px).
        width: of the picture (px).
        height: of the picture (px).
    """
    w = min(box[0] + box[2], width) - max(box[0], 0.0)
    h = min(box[1] + box[3], height) - max(box[1], 0.0)
    if w <= 0.0 or h <= 0.0:
        return 0.0
    return float(w * h / (box[2] * box[3]))


@njit(cache=True)
def clip_boxes(boxes: FloatArray, width: float, height: float) -> FloatArray:
    """Parts (N, 4) of boxes that lie inside a picture of `width` x `height` px; without area where none does.

    Args:
        boxes: (N, 4) left, top, width, height (px).
        width: of the picture (px).
        height: of the picture (px).
    """
    out = np.empty_like(boxes)
    for i in range(boxes.shape[0]):
        for axis in range(2):
            extent = width if axis == 0 else height
            low = min(max(boxes[i, axis], 0.0), extent)
            out[i, axis] = low
            out[i, 2 + axis] = max(min(boxes[i, axis] + boxes[i, 2 + axis], extent) - low, 0.0)
    return out


@njit(cache=True)
def occluded_fraction(boxes: FloatArray, existence: FloatArray) -> FloatArray:
    """Fraction (N,) of each box that the one track in front which covers most of it hides.

    On a plane road the box that reaches further down stands nearer. A doubtful track hides in proportion to
    its existence.

    Args:
        boxes: (N, 4) left, top, width, height (px).
        existence: (N,) probability of existence.
    """
    num = boxes.shape[0]
    out = np.zeros(num)
    order = np.argsort(boxes[:, 0], kind="mergesort")
    for a in range(num):
        i = order[a]
        right = boxes[i, 0] + boxes[i, 2]
        for b in range(a + 1, num):
            k = order[b]
            if boxes[k, 0] >= right:
                break
            width = min(right, boxes[k, 0] + boxes[k, 2]) - boxes[k, 0]
            bottom_i = boxes[i, 1] + boxes[i, 3]
            bottom_k = boxes[k, 1] + boxes[k, 3]
            height = min(bottom_i, bottom_k) - max(boxes[i, 1], boxes[k, 1])
            if height <= 0.0:
                continue
            behind, front = (i, k) if bottom_i < bottom_k else (k, i)
            covered = existence[front] * width * height / (boxes[behind, 2] * boxes[behind, 3])
            out[behind] = max(out[behind], covered)
    return out


@njit(cache=True)
def track_boxes(mean: FloatArray, size_mean: FloatArray) -> FloatArray:
    """Boxes (N, 4) left, top, width, height (px) of tracks.

    Args:
        mean: (N, 2, 3) per axis [p, v, a].
        size_mean: (N, 2, 2) ln width and ln height with their rates.
    """
    out = np.empty((mean.shape[0], 4))
    for i in range(mean.shape[0]):
        w = math.exp(min(max(size_mean[i, 0, 0], -_MOST_LOG_SIZE), _MOST_LOG_SIZE))
        h = math.exp(min(max(size_mean[i, 1, 0], -_MOST_LOG_SIZE), _MOST_LOG_SIZE))
        out[i, 0] = mean[i, 0, 0] - 0.5 * w
        out[i, 1] = mean[i, 1, 0] - 0.5 * h
        out[i, 2] = w
        out[i, 3] = h
    return out
