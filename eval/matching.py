"""One-to-one matches of truth and tracks, frame by frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray

#: A box that is matched to nothing counts as on an ignored one if this share of its area lies on it.
IGNORE_COVERED = 0.5


def match(iou: FloatArray, threshold: float) -> IntArray:
    """One-to-one match of largest total IoU among the pairs that reach `threshold`.

    Args:
        iou: (G, M).
        threshold: smallest IoU of a pair.

    Returns:
        (M,) index of the truth each track is matched to, -1 where to none.
    """
    from scipy.optimize import linear_sum_assignment

    truth_of = np.full(iou.shape[1], -1, dtype=np.int64)
    if iou.size:
        # A pair below the threshold is worth nothing, so that it never displaces a valid one.
        value = np.where(iou >= threshold - np.finfo(float).eps, iou, 0.0)
        rows, cols = linear_sum_assignment(value, maximize=True)
        good = value[rows, cols] > 0.0
        truth_of[cols[good]] = rows[good]
    return truth_of


def matched_entries(iou: Sequence[FloatArray], threshold: float) -> tuple[IntArray, IntArray]:
    """Match every frame of a sequence.

    Args:
        iou: by frame, (G, M) of the frame's truth and track entries.
        threshold: smallest IoU of a pair.

    Returns:
        The matched truth entries (P,) and track entries (P,), counted through all frames.
    """
    truth: list[IntArray] = []
    track: list[IntArray] = []
    truth_start = track_start = 0
    for matrix in iou:
        truth_of = match(matrix, threshold)
        found = np.flatnonzero(truth_of >= 0)
        truth.append(truth_start + truth_of[found])
        track.append(track_start + found)
        truth_start += matrix.shape[0]
        track_start += matrix.shape[1]
    none = np.zeros(0, dtype=np.int64)
    return np.concatenate([none, *truth]), np.concatenate([none, *track])
