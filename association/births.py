"""Births: which of the detections that no track took start new tracks."""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.association.overlap import overlap
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray


@njit(cache=True)
def choose_births(
    boxes: FloatArray,
    existence: FloatArray,
    sensor: IntArray,
    taken: IntArray,
    track_boxes: FloatArray,
    denied: BoolArray,
    min_existence: float,
    max_overlap: float,
) -> tuple[IntArray, IntArray, IntArray]:
    """Choose the leftover detections that start tracks, the surest first.

    A detection that coincides with a living track which its sensor does not deny, or with a birth by the same
    sensor, is a duplicate and starts none. One that coincides with a birth by another sensor is a second view
    of the new vehicle and joins it, if it is the first of its sensor: a vehicle has one box of each. A
    further one of that sensor is a duplicate if it coincides with the box that joined or with the birth as
    closely as with a living track, or half as closely with both; else it may join another birth or start a
    track of its own.

    Args:
        boxes: (M, 4) left, top, width, height (px).
        existence: (M,) probability that each detection is of a vehicle not tracked yet.
        sensor: (M,) sensor of each detection.
        taken: (M,) not zero where a track took the detection.
        track_boxes: (N, 4) boxes of the living tracks.
        denied: (N, S) tracks that a sensor has looked for in vain: its own box there is another thing.
        min_existence: least existence of a birth.
        max_overlap: IoU above which two boxes coincide; 1 refuses none.

    Returns:
        parents (B,) detections that start tracks; partner (M,) the index into `parents` of the birth that a
        detection joins, or -1; double (M,) a living track that the detection coincides with and that has not
        taken it, or -1.
    """
    num = len(existence)
    parents = np.empty(num, dtype=np.int64)
    partner = np.full(num, -1, dtype=np.int64)
    double = np.full(num, -1, dtype=np.int64)
    # The box that each birth has of each sensor.
    view = np.empty((num, np.max(sensor) + 1 if num > 0 else 0), dtype=np.int64)
    count = 0
    order = np.argsort(-existence, kind="mergesort")
    by_left = np.argsort(track_boxes[:, 0], kind="mergesort")
    left = track_boxes[by_left, 0]
    widest = np.max(track_boxes[:, 2]) if len(left) > 0 else 0.0
    # Births by upright strips of the picture, each as wide as the broadest box: lists that begin at `first`.
    broadest = np.max(boxes[:, 2]) if num > 0 else 0.0
    begin = np.min(boxes[:, 0]) if num > 0 else 0.0
    reach = np.max(boxes[:, 0]) - begin if num > 0 else 0.0
    strip_px = max(broadest, reach / max(num, 1), 1e-9)
    first = np.full(int(reach / strip_px) + 1, -1, dtype=np.int64)
    following = np.full(num, -1, dtype=np.int64)
    birth = np.full(num, -1, dtype=np.int64)  # that a detection has started or joined, or -1
    for j in order:
        if taken[j] or existence[j] < min_existence:
            continue
        refused = False
        if max_overlap < 1.0:
            right = boxes[j, 0] + boxes[j, 2]
            k = np.searchsorted(left, boxes[j, 0] - widest)
            while k < len(left) and left[k] < right and not refused:
                i = by_left[k]
                refused = overlap(boxes[j], track_boxes[i]) > max_overlap and not denied[i, sensor[j]]
                if refused:
                    double[j] = i
                k += 1
            if refused:
                continue
            for b in _births_near(boxes[j], boxes, begin, strip_px, first, following, birth):
                common = overlap(boxes[j], boxes[parents[b]])
                earlier = view[b, sensor[j]]
                if earlier < 0:
                    # Two sensors see one vehicle less exactly than one sensor sees it twice.
                    if common > 0.5 * max_overlap:
                        refused = True
                        partner[j] = b
                        birth[j] = b
                        view[b, sensor[j]] = j
                        break
                else:
                    again = overlap(boxes[j], boxes[earlier])
                    # Who joined fits less exactly, and so does a second box of what joined.
                    both = earlier != parents[b] and min(common, again) > 0.5 * max_overlap
                    if both or common > max_overlap or again > max_overlap:
                        refused = True
                        break
        if not refused:
            view[count] = -1
            view[count, sensor[j]] = j
            parents[count] = j
            birth[j] = count
            count += 1
        if birth[j] >= 0:
            strip = int((boxes[j, 0] - begin) / strip_px)
            following[j] = first[strip]
            first[strip] = j
    return parents[:count], partner, double


@njit(cache=True)
def _births_near(
    box: FloatArray,
    boxes: FloatArray,
    begin: float,
    strip_px: float,
    first: IntArray,
    following: IntArray,
    birth: IntArray,
) -> IntArray:
    """Births, ascending, of which any box overlaps another one: no other can coincide with it.

    Args:
        box: (4,) left, top, width, height (px).
        boxes: (M, 4) all detections.
        begin: where the first strip begins (px).
        strip_px: how wide each is, no box being broader.
        first: (P,) a detection whose left side lies in each strip, or -1.
        following: (M,) the next one of the same strip, or -1.
        birth: (M,) the birth that each of these has started or joined.
    """
    left, top, right, bottom = box[0], box[1], box[0] + box[2], box[1] + box[3]
    near = np.empty(8, dtype=np.int64)
    count = 0
    own, last = int((left - begin) / strip_px), int((right - begin) / strip_px)
    for strip in range(max(own - 1, 0), min(last, len(first) - 1) + 1):
        k = first[strip]
        while k >= 0:
            beside = boxes[k, 0] >= right or boxes[k, 0] + boxes[k, 2] <= left
            if not beside and boxes[k, 1] < bottom and boxes[k, 1] + boxes[k, 3] > top:
                if count == len(near):
                    near = np.concatenate((near, np.empty_like(near)))
                near[count] = birth[k]
                count += 1
            k = following[k]
    return np.unique(near[:count])
