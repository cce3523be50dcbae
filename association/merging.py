"""Merging: two tracks on one vehicle become one; the older confirmed identity survives."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from jeat_graph.association.overlap import overlap
from jeat_graph.data.arrays import FloatArray


@njit(cache=True)
def find_duplicates(
    boxes: FloatArray,
    velocity: FloatArray,
    velocity_var: FloatArray,
    confirmed: npt.NDArray[np.bool_],
    min_overlap: float,
    velocity_gate: float,
) -> npt.NDArray[np.bool_]:
    """Mark the tracks that duplicate another one.

    Two tracks are one vehicle if their boxes overlap and their velocities agree within their covariances. Of
    the two, a confirmed one survives a tentative one; among equals the one that stands first, the older.

    Args:
        boxes: (N, 4) left, top, width, height (px), tracks in order of age, the oldest first.
        velocity: (N, 2) px/s.
        velocity_var: (N, 2) variances (px²/s²).
        confirmed: (N,) whether a track is confirmed.
        min_overlap: least IoU of duplicates.
        velocity_gate: χ² bound on the difference of the velocities (2 degrees of freedom).

    Returns:
        (N,) true where the track is to be removed.
    """
    num = boxes.shape[0]
    remove = np.zeros(num, dtype=np.bool_)
    order = np.argsort(boxes[:, 0], kind="mergesort")
    # In the order of the sweep, so that its inner loop runs through memory and mostly stops early.
    left = boxes[order, 0]
    top = boxes[order, 1]
    bottom = top + boxes[order, 3]
    for a in range(num):
        i = order[a]
        right = boxes[i, 0] + boxes[i, 2]
        for b in range(a + 1, num):
            if left[b] >= right:
                break
            if top[b] >= bottom[a] or bottom[b] <= top[a]:
                continue
            k = order[b]
            if remove[i] or remove[k] or overlap(boxes[i], boxes[k]) < min_overlap:
                continue
            d2 = 0.0
            for axis in range(2):
                e = velocity[i, axis] - velocity[k, axis]
                d2 += e * e / (velocity_var[i, axis] + velocity_var[k, axis])
            if d2 > velocity_gate:
                continue
            older, younger = min(i, k), max(i, k)
            if confirmed[younger] and not confirmed[older]:
                remove[older] = True
            else:
                remove[younger] = True
    return remove
