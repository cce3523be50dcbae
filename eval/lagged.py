"""The filter, the smoother at any lag, and the smoother of the whole track, all at the same given times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from jeat_graph.arrays import FloatArray, IntArray
from jeat_graph.smoothers.rts import filter_track, motion_matrices, smooth_rts
from jeat_graph.smoothers.track_data import COINCIDENT_S, TrackData


@dataclass(frozen=True, eq=False)
class States:
    """States of one track at T times.

    Attributes:
        mean: (T, 2, 3) per axis [p, v, a] (px, px/s, px/s²).
        cov: (T, 2, 3, 3) covariances.
    """

    mean: FloatArray
    cov: FloatArray


@dataclass(frozen=True, eq=False)
class Innovations:
    """What the measurements of one track said that its filter had not expected.

    Attributes:
        t: (K,) times of keys with a measurement (s); coincident measurements are one.
        error: (K, 2) innovation (px).
        var: (K, 2) its variance S (px²).
    """

    t: FloatArray
    error: FloatArray
    var: FloatArray

    def normalised(self) -> FloatArray:
        """Innovations in units of their standard deviations (K, 2)."""
        return np.asarray(self.error / np.sqrt(self.var))

    def nis(self) -> FloatArray:
        """Normalised innovation squared (K,), χ² with two degrees of freedom if the filter is consistent."""
        return np.asarray((self.error**2 / self.var).sum(axis=1))


def with_times(track: TrackData, t: FloatArray) -> tuple[TrackData, IntArray]:
    """Give a track keys at further times, without measurements, which changes no estimate.

    White-jerk motion over an interval is the same whether it is made in one step or in two.

    Args:
        track: the data.
        t: (T,) times (s), not before the track's first.

    Returns:
        The data with more keys, and (T,) the key of each time.
    """
    times = np.asarray(t, dtype=np.float64)
    near = np.clip(np.searchsorted(track.t, times), 1, max(len(track) - 1, 1))
    near = np.minimum(near, len(track) - 1)
    near -= np.abs(times - track.t[near - 1]) < np.abs(times - track.t[near])
    here = np.abs(track.t[near] - times) <= COINCIDENT_S
    more = np.setdiff1d(times[~here], track.t)
    more = more[np.diff(more, prepend=-np.inf) > COINCIDENT_S]
    keys = np.sort(np.concatenate([track.t, more]))
    # An interval that is cut keeps its jerk on both sides; beyond the end the last one holds.
    q = track.q[np.minimum(np.searchsorted(track.t, keys), len(track) - 1)]
    q = np.where(q > 0.0, q, 1.0)
    old_to_new = np.searchsorted(keys, track.t)
    longer = TrackData(track.prior_mean, track.prior_cov, keys, q, old_to_new[track.key], track.z, track.r)
    at = np.searchsorted(keys, times - COINCIDENT_S)
    at = np.where(here, old_to_new[near], np.minimum(at, len(keys) - 1))
    return longer, at.astype(np.int64)


def states_at(
    track: TrackData, t: FloatArray, lags_s: Sequence[float]
) -> tuple[States, list[States], States, Innovations]:
    """Estimate a track's states at given times with more and more of the measurements that followed.

    Args:
        track: the data.
        t: (T,) times (s), not before the track's first.
        lags_s: how much later a measurement may be to be used (s); 0 is the filter.

    Returns:
        The filter's states, those at each lag, those of the whole track, and the filter's innovations.
    """
    longer, at = with_times(track, t)
    mean, cov = filter_track(longer)
    whole = smooth_rts(longer)
    F, Q = motion_matrices(np.diff(longer.t, prepend=longer.t[0]), longer.q)
    lagged = []
    for lag in lags_s:
        until = np.searchsorted(longer.t, longer.t[at] + lag + COINCIDENT_S, side="right") - 1
        lagged.append(States(*_smooth_back(F, Q, mean, cov, whole.gain, at, until)))
    return (
        States(mean[at], cov[at]),
        lagged,
        States(whole.mean[at], whole.cov[at]),
        _innovations(longer, F, Q, mean, cov),
    )


@njit(cache=True)
def _smooth_back(
    F: FloatArray,
    Q: FloatArray,
    mean: FloatArray,
    cov: FloatArray,
    gain: FloatArray,
    at: IntArray,
    until: IntArray,
) -> tuple[FloatArray, FloatArray]:
    """Smooth the states `at` (T,) with all up to keys `until` (T,): gains do not depend on what follows."""
    out_mean = np.empty((len(at), 2, 3))
    out_cov = np.empty((len(at), 2, 3, 3))
    for i in range(len(at)):
        for a in range(2):
            m = mean[until[i], a].copy()
            P = cov[until[i], a].copy()
            for k in range(until[i] - 1, at[i] - 1, -1):
                G = np.ascontiguousarray(gain[k, a])
                step = F[k + 1]
                filtered = np.ascontiguousarray(cov[k, a])
                predicted = step @ filtered @ step.T + Q[k + 1]
                m = mean[k, a] + G @ (m - step @ np.ascontiguousarray(mean[k, a]))
                P = filtered + G @ (P - predicted) @ G.T
            out_mean[i, a] = m
            out_cov[i, a] = P
    return out_mean, out_cov


def _innovations(
    track: TrackData, F: FloatArray, Q: FloatArray, mean: FloatArray, cov: FloatArray
) -> Innovations:
    z, info = track.fused()
    k = np.flatnonzero((info[:, 0] > 0.0) & (np.arange(len(track)) > 0))
    step = F[k][:, None]
    predicted = (step @ mean[k - 1][..., None])[..., 0]
    P = step @ cov[k - 1] @ step.swapaxes(-1, -2) + Q[k][:, None]
    return Innovations(track.t[k], z[k] - predicted[:, :, 0], P[:, :, 0, 0] + 1.0 / info[k])
