"""Labels in the own picture and on the own clock of the sensor that learns, and where others cannot see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.rig.common_picture import Way, own_time
from jeat_graph_sehn.teaching.labels import TrackLabels

#: Share of a box that must lie in the picture for it to be asked for.
LEAST_IN_VIEW = 0.6
#: Ids of the four masks around what other sensors see; -1 is that of labels elsewhere.
_BARS = -(10**9)
_CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def in_own_picture(labels: TrackLabels, way: Way | None, size_px: tuple[int, int]) -> TrackLabels:
    """Bring labels from the common picture and clock to those of a sensor, and cut them at its edges.

    Args:
        labels: as they are tracked.
        way: of the sensor to the common picture; None where both are the same.
        size_px: width and height of the sensor's picture.

    Returns:
        Labels in its picture. Boxes outside are left out; those of which it shows little are masked.
    """
    truth = labels.truth
    boxes, seen = truth.boxes, np.ones(len(truth), dtype=bool)
    if way is not None and way.picture is not None:
        boxes, seen = way.picture.back(boxes)
        boxes = np.where(seen[:, None], boxes, 0.0)
    t, frames = truth.t, truth.frame_times()
    if way is not None and way.clock is not None:
        t, frames = own_time(t, way.clock), own_time(frames, way.clock)
    low = np.clip(boxes[:, :2], 0.0, size_px)
    high = np.clip(boxes[:, :2] + boxes[:, 2:], 0.0, size_px)
    left = (high - low).prod(axis=1)
    there = seen & (left > 0.0)
    share = left / np.maximum(boxes[:, 2:].prod(axis=1), 1e-9)
    moved = replace(
        truth,
        t=t,
        boxes=np.hstack([low, high - low]),
        ignore=truth.ignore | (share < LEAST_IN_VIEW),
        frames=frames,
    )
    return TrackLabels(moved, labels.weight).take(there)


def beyond_views(
    views: Sequence[Way | None], own: Way | None, common_px: tuple[float, float], size_px: tuple[int, int]
) -> FloatArray:
    """Return what of a picture no other sensor sees, as boxes (B, 4), left, top, width, height (px).

    It is what lies outside the largest upright rectangle that one of them sees wholly.

    Args:
        views: of the other sensors.
        own: way of the sensor whose picture it is.
        common_px: width and height of the common picture.
        size_px: width and height of this picture.
    """
    best = np.zeros(4)
    for view in views:
        seen = _inner(_corners(view, own, common_px, size_px), size_px)
        if (seen[2:] - seen[:2]).prod() > (best[2:] - best[:2]).prod():
            best = seen
    (left, top, right, bottom), (width, height) = best, size_px
    bars = np.array(
        [
            [0.0, 0.0, left, height],
            [right, 0.0, width - right, height],
            [0.0, 0.0, width, top],
            [0.0, bottom, width, height - bottom],
        ]
    )
    return bars[(bars[:, 2:] > 0.0).all(axis=1)]


def masking_bars(labels: TrackLabels, bars: FloatArray) -> TrackLabels:
    """Add masks that are there at all times.

    Args:
        labels: of a sensor's own picture.
        bars: (B, 4) left, top, width, height (px).
    """
    truth, frames = labels.truth, labels.truth.frame_times()
    count = len(bars) * len(frames)
    more = GroundTruth(
        t=np.concatenate([truth.t, np.repeat(frames, len(bars))]),
        object_id=np.concatenate([truth.object_id, np.tile(_BARS - np.arange(len(bars)), len(frames))]),
        boxes=np.concatenate([truth.boxes, np.tile(bars, (len(frames), 1))]),
        motion=None,
        ignore=np.concatenate([truth.ignore, np.ones(count, dtype=bool)]),
        frames=frames,
    )
    return TrackLabels(more, np.concatenate([labels.weight, np.zeros(count)]))


def _corners(
    view: Way | None, own: Way | None, common_px: tuple[float, float], size_px: tuple[int, int]
) -> FloatArray:
    """Return the corners (4, 2) of another sensor's picture in this one (px), clockwise from upper left."""
    if view is None or view.picture is None or view.own is None:
        corners = _CORNERS * np.array(common_px)
    else:
        corners = view.picture.points(_CORNERS * np.array(view.own))
    if own is None or own.picture is None:
        return np.asarray(corners)
    # A point is a box without height: its depth is that of what stands there.
    back, _ = own.picture.back(np.hstack([corners - 0.5e-3, np.full((4, 2), 1e-3)]))
    return np.asarray(back[:, :2] + back[:, 2:] / 2.0)


def _inner(corners: FloatArray, size_px: tuple[int, int]) -> FloatArray:
    """Return an upright rectangle within a quadrilateral and a picture: left, top, right, bottom (px).

    Corners that the other camera cannot map say nothing: the whole picture counts as seen.
    """
    if not np.isfinite(corners).all():
        return np.array([0.0, 0.0, *size_px])
    upper_left, upper_right, lower_right, lower_left = corners
    low = np.array([max(upper_left[0], lower_left[0]), max(upper_left[1], upper_right[1])])
    high = np.array([min(upper_right[0], lower_right[0]), min(lower_left[1], lower_right[1])])
    low, high = np.clip(low, 0.0, size_px), np.clip(high, 0.0, size_px)
    return np.concatenate([low, np.maximum(high, low)])
