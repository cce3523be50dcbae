"""Gaps of a track's detections, and what is known of the detections at their ends."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray


def whole_gaps(confirmed: BoolArray, missed: FloatArray, last: BoolArray) -> FloatArray:
    """Return how long (K,) the whole gap is that each update lies in, in expected detections; 0 in none."""
    out, whole = np.zeros(len(missed)), 0.0
    for k in np.flatnonzero(last)[::-1].tolist():
        whole = 0.0 if confirmed[k] else max(whole, float(missed[k]))
        out[k] = whole
    return out


def known_around(later: FloatArray, last: BoolArray, before: float, count: int) -> tuple[FloatArray, float]:
    """Return what comes later says of the detections around each update, and of the last of the first ones.

    Args:
        later: (K,) of each update's own detection, below 0 where nothing is known.
        last: (K,) whether it is the last of its step.
        before: of the last detection before the first update.
        count: of the first ones.

    Returns:
        (K,) the less of both sides, 1 where nothing is known of either; and of the last of `count` updates.
    """
    if before < 0.0 and not (later >= 0.0).any():
        return np.ones(len(later)), before
    out, behind, known = np.ones(len(later)), -1.0, before
    for k in range(len(later) - 1, -1, -1):
        if last[k] and later[k] >= 0.0:
            behind = float(later[k])
        if behind >= 0.0:
            out[k] = behind
    for k in range(len(later)):
        if last[k] and later[k] >= 0.0:
            before = float(later[k])
        if before >= 0.0:
            out[k] = min(out[k], before)
        known = before if k < count else known
    return out, known
