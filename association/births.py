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
    sweep = np.argsort(boxes[:, 0], kind="mergesort")
    # In the order of the sweep: the birth that a detection has started or joined, or -1.
    birth = np.full(num, -1, dtype=np.int64)
    place = np.empty(num, dtype=np.int64)
    place[sweep] = np.arange(num)
    swept = boxes[sweep]
    broadest = np.max(boxes[:, 2]) if num > 0 else 0.0
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
            for b in _births_near(boxes[j], swept, broadest, birth):
                common = overlap(boxes[j], boxes[parents[b]])
                earlier = view[b, sensor[j]]
                if earlier < 0:
                    # Two sensors see one vehicle less exactly than one sensor sees it twice.
                    if common > 0.5 * max_overlap:
                        refused = True
                        partner[j] = b
                        birth[place[j]] = b
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
            birth[place[j]] = count
            count += 1
    return parents[:count], partner, double


@njit(cache=True)
def _births_near(box: FloatArray, swept: FloatArray, broadest: float, birth: IntArray) -> IntArray:
    """Births, ascending, of which any box overlaps another one: no other can coincide with it.

    Args:
        box: (4,) left, top, width, height (px).
        swept: (M, 4) all detections from left to right.
        broadest: the greatest of their widths (px).
        birth: (M,) the birth that each of these has started or joined, or -1.
    """
    left, top, right, bottom = box[0], box[1], box[0] + box[2], box[1] + box[3]
    near = np.empty(8, dtype=np.int64)
    count = 0
    k = np.searchsorted(swept[:, 0], left - broadest)
    while k < len(swept) and swept[k, 0] < right:
        beside = (
            swept[k, 1] >= bottom or swept[k, 1] + swept[k, 3] <= top or swept[k, 0] + swept[k, 2] <= left
        )
        if birth[k] >= 0 and not beside:
            if count == len(near):
                near = np.concatenate((near, np.empty_like(near)))
            near[count] = birth[k]
            count += 1
        k += 1
    return np.unique(near[:count])
