"""Merging: two tracks on one vehicle become one; the older confirmed identity survives.

Two people who walk behind each other have one box and one velocity, too. But they were seen apart before: one
sensor found each of them where no other track was. What has never been seen apart may be one.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from jeat_graph.association.overlap import overlap
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray


@njit(cache=True)
def overlapping_pairs(boxes: FloatArray) -> tuple[IntArray, FloatArray]:
    """Pairs of boxes that overlap at all.

    Args:
        boxes: (N, 4) left, top, width, height (px).

    Returns:
        (P, 2) rows of each pair, and (P,) its IoU; from left to right.
    """
    num = boxes.shape[0]
    order = np.argsort(boxes[:, 0], kind="mergesort")
    # In the order of the sweep, so that its inner loop runs through memory and mostly stops early.
    left = boxes[order, 0]
    top = boxes[order, 1]
    bottom = top + boxes[order, 3]
    pairs = np.empty((max(2 * num, 16), 2), dtype=np.int64)
    iou = np.empty(len(pairs))
    count = 0
    for a in range(num):
        i = order[a]
        right = boxes[i, 0] + boxes[i, 2]
        for b in range(a + 1, num):
            if left[b] >= right:
                break
            if top[b] >= bottom[a] or bottom[b] <= top[a]:
                continue
            if count == len(pairs):
                pairs = np.concatenate((pairs, np.empty_like(pairs)))
                iou = np.concatenate((iou, np.empty_like(iou)))
            pairs[count, 0], pairs[count, 1] = i, order[b]
            iou[count] = overlap(boxes[i], boxes[order[b]])
            count += 1
    return pairs[:count], iou[:count]


@njit(cache=True)
def stands_apart(num: int, pairs: IntArray, iou: FloatArray, most_overlap: float) -> BoolArray:
    """Say of each of `num` tracks (N,) whether none overlaps it by more than an IoU of `most_overlap`.

    Args:
        num: N.
        pairs: (P, 2) of `overlapping_pairs`.
        iou: (P,) of the same.
        most_overlap: IoU.
    """
    apart = np.ones(num, dtype=np.bool_)
    for p in range(len(pairs)):
        if iou[p] > most_overlap:
            apart[pairs[p, 0]] = False
            apart[pairs[p, 1]] = False
    return apart


@njit(cache=True)
def known_to_be_two(pairs: IntArray, born: FloatArray, seen_apart: FloatArray) -> BoolArray:
    """Say of each pair (P,) whether one sensor has seen both apart from all others since there are both.

    Args:
        pairs: (P, 2) rows of tracks.
        born: (N,) when each track began (s).
        seen_apart: (N, S) when each sensor last saw it apart from all others (s).
    """
    two = np.zeros(len(pairs), dtype=np.bool_)
    for p in range(len(pairs)):
        i, k = pairs[p, 0], pairs[p, 1]
        both_since = max(born[i], born[k])
        for s in range(seen_apart.shape[1]):
            two[p] = two[p] or (seen_apart[i, s] > both_since and seen_apart[k, s] > both_since)
    return two


@njit(cache=True)
def find_duplicates(
    pairs: IntArray,
    velocity: FloatArray,
    velocity_var: FloatArray,
    confirmed: npt.NDArray[np.bool_],
    velocity_gate: float,
) -> npt.NDArray[np.bool_]:
    """Mark the tracks that duplicate another one.

    Two tracks whose boxes nearly coincide are one vehicle if their velocities agree within their covariances.
    Of the two, a confirmed one survives a tentative one; among equals the one that stands first, the older.

    Args:
        pairs: (P, 2) rows of tracks whose boxes nearly coincide, not known to be two; the oldest track first.
        velocity: (N, 2) px/s.
        velocity_var: (N, 2) variances (px²/s²).
        confirmed: (N,) whether a track is confirmed.
        velocity_gate: χ² bound on the difference of the velocities (2 degrees of freedom).

    Returns:
        (N,) true where the track is to be removed.
    """
    remove = np.zeros(len(confirmed), dtype=np.bool_)
    for p in range(len(pairs)):
        i, k = pairs[p, 0], pairs[p, 1]
        if remove[i] or remove[k]:
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
