"""One track as its filter went through it, and its states with more and more of what followed.

A filter's record of an update is its state before and after it, and the transition from the record before.
That is all a smoother needs, whatever the measurements were: it is the input of the Rauch–Tung–Striebel pass
(`state_rts`) and of the factor graph (`gtsam.filter_graph`), and it tells by itself how well the measurements
fitted: with d = m − m⁻ of an update the covariance of d is P⁻ − P, since d = K y and Cov d = K S Kᵀ.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.smoothers.state_rts import FilterRecord

#: Of a state per axis the first three are place, velocity and acceleration.
MOTION = 3
# An update that gains less of the variance than this has measured nothing.
_LEAST_GAIN = 1e-9


class Output(NamedTuple):
    """How place, velocity and acceleration follow from a track's states.

    Attributes:
        mean: from means (..., A, D), those of the three (..., A, 3).
        covariance: from means and covariances (..., A, D, D), that of the three (..., A, 3, 3).
    """

    mean: Callable[[FloatArray], FloatArray]
    covariance: Callable[[FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class FilteredTrack:
    """The K records of one track, of axes A and states D.

    Attributes:
        track_id: identity.
        t: (K,) times (s), not falling.
        F: (K, A, D, D) transition from the record before; of the first one it does not matter.
        predicted_mean: (K, A, D) before each update.
        predicted_covariance: (K, A, D, D).
        mean: (K, A, D) after it.
        covariance: (K, A, D, D).
        sensor: (K,) index of the sensor whose box was taken in, −1 where none was.
        output: what is told as place, velocity and acceleration; None: the first three of a state.
    """

    track_id: int
    t: FloatArray
    F: FloatArray
    predicted_mean: FloatArray
    predicted_covariance: FloatArray
    mean: FloatArray
    covariance: FloatArray
    sensor: IntArray
    output: Output | None = None

    def __len__(self) -> int:
        return len(self.t)

    def motion(self, mean: FloatArray) -> FloatArray:
        """Return what is told (..., 3) of states (..., D): place, velocity and acceleration."""
        return mean[..., :MOTION] if self.output is None else self.output.mean(mean)

    def motion_covariance(self, mean: FloatArray, covariance: FloatArray) -> FloatArray:
        """Return the covariance (..., A, 3, 3) of what is told of states (..., A, D) with theirs."""
        if self.output is None:
            return covariance[..., :MOTION, :MOTION]
        return self.output.covariance(mean, covariance)

    def normalised_innovations(self) -> tuple[IntArray, FloatArray]:
        """Return the updates (M,) that measured something, and by how much they moved the place (M, A).

        In units of the standard deviation that the filter gives that; standard normal if it is consistent.
        """
        gained = (self.predicted_covariance - self.covariance)[:, :, 0, 0]
        moved = (self.mean - self.predicted_mean)[:, :, 0]
        known = (self.sensor >= 0) & (gained > _LEAST_GAIN * self.predicted_covariance[:, :, 0, 0]).all(
            axis=1
        )
        known[:1] = False  # what began the track was not expected
        rows = np.flatnonzero(known)
        return rows, np.asarray(moved[rows] / np.sqrt(gained[rows]))

    def smoothed_until(self, at: IntArray, until: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return states as the measurements up to later records make them.

        Args:
            at: (T,) records.
            until: (T,) the last record whose measurements count, not before `at`.

        Returns:
            Means (T, A, D) and covariances (T, A, D, D).
        """
        gain = self._gains()
        now = np.maximum(until, at)
        mean, covariance = self.mean[now], self.covariance[now]
        for _ in range(int((now - at).max(initial=0))):
            rows = np.flatnonzero(now > at)
            later, before = now[rows], now[rows] - 1
            G = gain[before]
            correction = (mean[rows] - self.predicted_mean[later])[..., None]
            mean[rows] = self.mean[before] + (G @ correction)[..., 0]
            spread = covariance[rows] - self.predicted_covariance[later]
            spread = self.covariance[before] + G @ spread @ np.swapaxes(G, -1, -2)
            covariance[rows] = (spread + np.swapaxes(spread, -1, -2)) / 2.0
            now[rows] = before
        return mean, covariance

    def smoothed(self) -> tuple[FloatArray, FloatArray]:
        """Return the states (K, A, D) and covariances (K, A, D, D) that all measurements make."""
        gain = self._gains()
        mean, covariance = self.mean.copy(), self.covariance.copy()
        for k in range(len(self) - 2, -1, -1):
            G = gain[k]
            mean[k] += (G @ (mean[k + 1] - self.predicted_mean[k + 1])[..., None])[..., 0]
            spread = covariance[k] + G @ (covariance[k + 1] - self.predicted_covariance[k + 1]) @ np.swapaxes(
                G, -1, -2
            )
            covariance[k] = (spread + np.swapaxes(spread, -1, -2)) / 2.0
        return mean, covariance

    def _gains(self) -> FloatArray:
        """Return G (K − 1, A, D, D) of `state_rts`, solved in a scaled state."""
        predicted = self.predicted_covariance[1:]
        scale = np.sqrt(np.diagonal(predicted, axis1=-2, axis2=-1))
        scaled = predicted / (scale[..., :, None] * scale[..., None, :])
        forward = (self.F[1:] @ self.covariance[:-1]) / scale[..., :, None]
        return np.asarray(np.swapaxes(np.linalg.solve(scaled, forward), -1, -2) / scale[..., None, :])


def tracks_of(
    records: Sequence[FilterRecord], t: Sequence[float], sensors: Sequence[IntArray]
) -> list[FilteredTrack]:
    """Return the tracks of a filter's records, in ascending order of identity.

    Args:
        records: of successive scans, each with all tracks that lived through it.
        t: of each record (s).
        sensors: (N,) of each record, which sensor's box each track took in, −1 where it took none.
    """
    if not records:
        return []
    counts = [len(one.track_id) for one in records]
    ids = np.concatenate([one.track_id for one in records])
    order = np.argsort(ids, kind="stable")
    axes = records[0].mean.shape[1]
    before, before_cov, after, after_cov = (
        np.concatenate([getattr(one, name) for one in records])[order]
        for name in ("predicted_mean", "predicted_covariance", "mean", "covariance")
    )
    F = np.concatenate([np.broadcast_to(one.F, (len(one.F), axes, *one.F.shape[2:])) for one in records])[
        order
    ]
    times, sensor = np.repeat(t, counts)[order], np.concatenate(sensors)[order]
    starts = np.flatnonzero(np.diff(ids[order], prepend=-1))
    out = []
    for a, b in zip(starts, [*starts[1:], len(order)], strict=True):
        rows = slice(int(a), int(b))
        states = before[rows], before_cov[rows], after[rows], after_cov[rows]
        out.append(FilteredTrack(int(ids[order[a]]), times[rows], F[rows], *states, sensor[rows]))
    return out
