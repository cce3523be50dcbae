"""Looks up what is drawn at each time: tracks of both tables, their trails, and the truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.picture_map import PictureMap
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.eval.resampling import Resampled, interpolate_to, predict_to

TRAIL_S = 1.0
_TRUTH_REACH = 0.6  # of the truth's frame period
_TOLERANCE_S = 1e-6


@dataclass(frozen=True, eq=False)
class Marks:
    """Tracks of one kind at one time.

    Attributes:
        track_id: (K,) identity.
        boxes: (K, 4) left, top, width, height (px).
        centre: (K, 2) of the box, not clipped (px).
        sigma: (K, 2) its standard deviations (px); NaN where they are not known.
        trails: of each track, the last centres (L, 2), the last one being `centre`.
    """

    track_id: IntArray
    boxes: FloatArray
    centre: FloatArray
    sigma: FloatArray
    trails: Sequence[FloatArray]


def back_in(marks: Marks, way: PictureMap | None) -> Marks:
    """Return the tracks that a sensor can see, as they lie in its own picture; all of them without a way."""
    if way is None or not len(marks.boxes):
        return marks
    own, seen = way.back(marks.boxes)
    rows = np.flatnonzero(seen)
    sides = marks.boxes[rows, 2:]
    trails = []
    for k in rows.tolist():
        trail = marks.trails[k]
        # A trail's points have no size: that of the box now.
        size = np.broadcast_to(marks.boxes[k, 2:], trail.shape)
        points, good = way.back(np.concatenate([trail - 0.5 * size, size], axis=1))
        trails.append((points[:, :2] + 0.5 * points[:, 2:])[good])
    return Marks(
        track_id=marks.track_id[rows],
        boxes=own[rows],
        centre=own[rows, :2] + 0.5 * own[rows, 2:],
        sigma=marks.sigma[rows] * own[rows, 2:] / sides,
        trails=trails,
    )


class TracksAt:
    """One table at given times: causal estimates predicted, smoothed ones interpolated, as `eval` does.

    Args:
        table: the table.
        times: (T,) ascending (s).
        kind: `causal` or `smoothed`.
        instants: (I,) times at which the causal tracker ran (s), if known.
        trail_s: how far trails go back (s).
    """

    def __init__(
        self,
        table: Trajectories,
        times: FloatArray,
        kind: str,
        instants: FloatArray | None = None,
        trail_s: float = TRAIL_S,
    ) -> None:
        self._times = times
        self._trail_s = trail_s
        resample = predict_to if kind == "causal" else interpolate_to
        self._found: Resampled = resample(table, times, instants=instants)
        self._start = np.searchsorted(self._found.frame, np.arange(len(times) + 1))
        order = np.argsort(table.t, kind="stable")
        self._row_t, self._row_id = table.t[order], table.track_id[order]
        self._row_centre = table.mean[order, :2]

    def at(self, k: int) -> Marks:
        """Return the tracks at time number `k`."""
        rows = slice(int(self._start[k]), int(self._start[k + 1]))
        ids, centre = self._found.track_id[rows], self._found.mean[rows, :2]
        return Marks(
            track_id=ids,
            boxes=self._found.boxes[rows],
            centre=centre,
            sigma=np.sqrt(self._found.var[rows, :2]),
            trails=self._trails(float(self._times[k]), ids, centre),
        )

    def _trails(self, t: float, ids: IntArray, centre: FloatArray) -> list[FloatArray]:
        if self._trail_s == 0.0:
            return [here[None] for here in centre]
        first, last = np.searchsorted(self._row_t, [t - self._trail_s, t + _TOLERANCE_S])
        part = slice(int(first), int(last))
        # In order of tracks, then time: a stable sort keeps the order of the rows.
        order = np.argsort(self._row_id[part], kind="stable")
        owner, place = self._row_id[part][order], self._row_centre[part][order]
        begin, end = np.searchsorted(owner, ids), np.searchsorted(owner, ids, side="right")
        return [
            np.concatenate([place[a:b], here[None]])
            for a, b, here in zip(begin.tolist(), end.tolist(), centre, strict=True)
        ]


class TruthAt:
    """True boxes at given times, between two frames of the truth on the straight way from one to the other.

    An object that only one of the two frames has is there up to halfway. Where frames are much further apart
    than usual, and before the first and after the last, nothing is known but close to a frame.

    Args:
        truth: the truth.
    """

    def __init__(self, truth: GroundTruth) -> None:
        order = np.argsort(truth.t, kind="stable")
        self._t, self._boxes, self._ignore = truth.t[order], truth.boxes[order], truth.ignore[order]
        self._id = truth.object_id[order]
        self._frames = truth.frame_times()
        self._period = float(np.median(np.diff(self._frames))) if len(self._frames) > 1 else 0.1

    def at(self, t: float) -> tuple[FloatArray, FloatArray]:
        """Return the boxes (K, 4) of objects to be found, and those (L, 4) that are ignored."""
        none = np.zeros((0, 4))
        if not len(self._frames):
            return none, none
        near = int(np.abs(self._frames - t).argmin())
        away = float(t - self._frames[near])
        if abs(away) > _TRUTH_REACH * self._period:
            return none, none
        rows = self._rows(near)
        boxes, ignore = self._boxes[rows].copy(), self._ignore[rows]
        other = near + (1 if away > 0.0 else -1)
        if abs(away) > _TOLERANCE_S and 0 <= other < len(self._frames):
            share = away / float(self._frames[other] - self._frames[near])
            there = self._rows(other)
            # Ignored regions may share an id; those stay as they are.
            ids, mine, others = np.intersect1d(self._id[rows], self._id[there], return_indices=True)
            once = np.array([(self._id[rows] == i).sum() == 1 for i in ids], dtype=bool)
            mine, others = mine[once], others[once]
            boxes[mine] += share * (self._boxes[there][others] - boxes[mine])
        return boxes[~ignore], boxes[ignore]

    def _rows(self, frame: int) -> slice:
        t = self._frames[frame]
        first, last = np.searchsorted(self._t, [t - _TOLERANCE_S, t + _TOLERANCE_S])
        return slice(int(first), int(last))
