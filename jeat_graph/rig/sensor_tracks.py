"""The tracks of one sensor alone, on a steady grid of its own clock: what registration compares."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jeat_graph.association.overlap import pairwise_iou
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.detections import Detections

#: Step of the grid (s).
STEP_S = 0.1
# Tracks that are shorter say little of motion (s); a hole that is longer is not bridged (s).
_LEAST_S, _LONGEST_HOLE_S = 1.0, 0.6
# Detections of so long become one measurement (s): their errors last longer.
_BIN_S = 0.2
# A detection belongs to the box of a track that it overlaps by this.
_SAME_IOU = 0.4
# What moves by less than this many of its sizes stands still.
_MOVES = 1.0
# Scans that are looked at in one step.
_SCANS_A_STEP = 16


class TrackMeasurements(NamedTuple):
    """Measurements of one track.

    Attributes:
        t: (M,) times (s).
        centre: (M, 2) of the boxes (px).
        size: (M, 2) width and height (px), smoothed.
    """

    t: FloatArray
    centre: FloatArray
    size: FloatArray


@dataclass(frozen=True, eq=False)
class SensorTracks:
    """Tracks of one sensor.

    Attributes:
        start_s: time of the grid's first step (s).
        centre: (N, T, 2) of each track at each step (px), NaN where it is not there.
        size: (N, T, 2) width and height (px).
        measured: N, the measurements of each.
        moves: (N,) whether it moves.
    """

    start_s: float
    centre: FloatArray
    size: FloatArray
    measured: list[TrackMeasurements]
    moves: FloatArray

    @property
    def steps(self) -> int:
        """Number of steps T of the grid."""
        return int(self.centre.shape[1])

    @property
    def end_s(self) -> float:
        """Time of the last step (s)."""
        return self.start_s + STEP_S * (self.steps - 1)

    def __len__(self) -> int:
        return len(self.measured)

    def present(self) -> IntArray:
        """Return which tracks are there at each step: (T, P) numbers, -1 where there are fewer."""
        there = np.isfinite(self.centre[:, :, 0])
        most = max(int(there.sum(axis=0).max(initial=0)), 1)
        order = np.argsort(~there, axis=0, kind="stable")[:most].T
        return np.where(np.take_along_axis(there.T, order, axis=1), order, -1)


def sensor_tracks_in_steps(
    t: FloatArray, track_id: IntArray, boxes: FloatArray, detections: Detections
) -> Generator[None, None, SensorTracks]:
    """Put smoothed tracks on a grid, and find the detections that they rest on; a part of a track a step.

    Args:
        t: (R,) times of the rows (s).
        track_id: (R,) whose they are.
        boxes: (R, 4) left, top, width, height (px).
        detections: of this sensor alone.
    """
    start = float(np.floor(t.min() / STEP_S)) * STEP_S if len(t) else 0.0
    # Two at least: velocities are taken of it, also where there is no track.
    steps = max(int(np.ceil((t.max() - start) / STEP_S)) + 1 if len(t) else 0, 2)
    grid = start + STEP_S * np.arange(steps)
    centres, sizes, measured, moves = [], [], [], []
    order = np.lexsort((t, track_id))
    for rows in np.split(order, np.flatnonzero(np.diff(track_id[order])) + 1) if len(order) else []:
        when, own = t[rows], boxes[rows]
        if when[-1] - when[0] < _LEAST_S:
            continue
        centre, size = own[:, :2] + 0.5 * own[:, 2:], own[:, 2:]
        one = yield from _measurements(when, own, detections)
        if len(one.t) < 2:
            continue
        at = np.column_stack([np.interp(grid, when, v, np.nan, np.nan) for v in (*centre.T, *size.T)])
        after = np.clip(np.searchsorted(when, grid), 1, len(when) - 1)
        at[when[after] - when[after - 1] > _LONGEST_HOLE_S] = np.nan
        centres.append(at[:, :2])
        sizes.append(at[:, 2:])
        measured.append(one)
        far = np.linalg.norm(centre[-1] - centre[0])
        moves.append(float(far > _MOVES * np.sqrt(np.median(size.prod(axis=1)))))
        yield
    empty = np.zeros((0, steps, 2))
    return SensorTracks(
        start,
        np.stack(centres) if centres else empty,
        np.stack(sizes) if sizes else empty,
        measured,
        np.array(moves),
    )


def _measurements(
    t: FloatArray, boxes: FloatArray, detections: Detections
) -> Generator[None, None, TrackMeasurements]:
    """Take the detections that a track rests on, a few at a time, in their mean."""
    first = np.searchsorted(detections.scan_t, t - 1e-9)
    times, centres, sizes = [], [], []
    for k, scan in enumerate(first):
        if k % _SCANS_A_STEP == 0:
            yield
        if scan >= detections.num_scans or abs(detections.scan_t[scan] - t[k]) > 1e-6:
            continue
        found = detections.boxes[detections.scan_start[scan] : detections.scan_start[scan + 1]]
        if not len(found):
            continue
        overlap = pairwise_iou(found, boxes[k : k + 1])[:, 0]
        best = int(overlap.argmax())
        if overlap[best] >= _SAME_IOU:
            times.append(t[k])
            centres.append(found[best, :2] + 0.5 * found[best, 2:])
            sizes.append(boxes[k, 2:])
    if not times:
        return TrackMeasurements(np.zeros(0), np.zeros((0, 2)), np.zeros((0, 2)))
    when, centre, size = np.array(times), np.array(centres), np.array(sizes)
    smooth = boxes[:, :2] + 0.5 * boxes[:, 2:]
    path = np.column_stack([np.interp(when, t, axis) for axis in smooth.T])
    bins = np.unique(np.floor(when / _BIN_S), return_inverse=True)[1]
    count = np.bincount(bins)

    def mean(values: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(bins, values) / count)

    middle = mean(when)
    # In the mean of some time a track that curves is beside its own place there: means are of what is left.
    at = np.column_stack([np.interp(middle, t, axis) for axis in smooth.T])
    left = np.column_stack([mean(axis) for axis in (centre - path).T])
    return TrackMeasurements(middle, at + left, np.column_stack([mean(axis) for axis in size.T]))


def joined(tracks: Sequence[TrackMeasurements]) -> FloatArray:
    """All measured centres (K, 2)."""
    return np.concatenate([one.centre for one in tracks]) if tracks else np.zeros((0, 2))
