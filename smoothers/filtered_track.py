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
from jeat_graph.smoothers.state_rts import FilterRecord, gains, rts_step

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
        output: what is reported as place, velocity and acceleration; None: the first three of a state.
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
        """Return the output (..., 3) of states (..., D): place, velocity and acceleration."""
        return mean[..., :MOTION] if self.output is None else self.output.mean(mean)

    def motion_covariance(self, mean: FloatArray, covariance: FloatArray) -> FloatArray:
        """Return the covariance (..., A, 3, 3) of the output of states (..., A, D) with theirs."""
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
        now = np.maximum(until, at)
        mean, covariance = self.mean[now], self.covariance[now]
        gain = gains(self.covariance[:-1], self.F[1:], self.predicted_covariance[1:])
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
        return smoothed_together([self])[0]


def smoothed_together(tracks: Sequence[FilteredTrack]) -> list[tuple[FloatArray, FloatArray]]:
    """Return the states (K, A, D) and covariances (K, A, D, D) of tracks that all their measurements make.

    The pass goes back over all tracks at once, each from its own last record.
    """
    out = [(track.mean.copy(), track.covariance.copy()) for track in tracks]
    order = sorted(range(len(tracks)), key=lambda i: -len(tracks[i]))
    for back in range(1, max((len(track) for track in tracks), default=0)):
        # Those that are longer stand first.
        active = [i for i in order if len(tracks[i]) > back]
        at = [len(tracks[i]) - 1 - back for i in active]
        pairs = list(zip(active, at, strict=True))
        mean, covariance = rts_step(
            (
                np.stack([tracks[i].mean[k] for i, k in pairs]),
                np.stack([tracks[i].covariance[k] for i, k in pairs]),
            ),
            np.stack([tracks[i].F[k + 1] for i, k in pairs]),
            (
                np.stack([tracks[i].predicted_mean[k + 1] for i, k in pairs]),
                np.stack([tracks[i].predicted_covariance[k + 1] for i, k in pairs]),
            ),
            (np.stack([out[i][0][k + 1] for i, k in pairs]), np.stack([out[i][1][k + 1] for i, k in pairs])),
        )
        for n, (i, k) in enumerate(pairs):
            out[i][0][k], out[i][1][k] = mean[n], covariance[n]
    return out


def tracks_of(records: Sequence[FilterRecord], t: Sequence[float]) -> list[FilteredTrack]:
    """Return the tracks of a filter's records, in ascending order of identity.

    Args:
        records: of successive scans, each with all tracks that lived through it.
        t: of each record (s).
    """
    if not records:
        return []
    counts = [len(one.track_id) for one in records]
    ids = np.concatenate([one.track_id for one in records])
    order = np.argsort(ids, kind="stable")
    before, before_cov, after, after_cov = (
        np.concatenate([getattr(one, name) for one in records])[order]
        for name in ("predicted_mean", "predicted_covariance", "mean", "covariance")
    )
    F = np.concatenate([np.broadcast_to(one.F, one.covariance.shape) for one in records])[order]
    times = np.repeat(t, counts)[order]
    sensor = np.concatenate([one.sensor for one in records])[order]
    starts = np.flatnonzero(np.diff(ids[order], prepend=-1))
    out = []
    for a, b in zip(starts, [*starts[1:], len(order)], strict=True):
        rows = slice(int(a), int(b))
        states = before[rows], before_cov[rows], after[rows], after_cov[rows]
        out.append(FilteredTrack(int(ids[order[a]]), times[rows], F[rows], *states, sensor[rows]))
    return out
