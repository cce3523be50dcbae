"""Smoothing of a box's size: ln w and ln h, each with a rate that drifts, apart from the motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from jeat_graph.arrays import FloatArray
from jeat_graph.errors import DataError
from jeat_graph.filters.motion import size_process_noise, size_transition
from jeat_graph.smoothers.rts import backward, forward
from jeat_graph.smoothers.track_data import COINCIDENT_S, fuse, group_times


@dataclass(frozen=True, eq=False)
class SmoothedSize:
    """Smoothed sizes of one track.

    Attributes:
        t: (K,) times (s), ascending.
        q: (K,) root spectral density of the rate over the interval that ends there (1/s^1.5).
        mean: (K, 2, 2) for width and height, [ln size, rate] (ln px, 1/s).
        cov: (K, 2, 2, 2) covariances.
        gain: (K, 2, 2, 2) smoother gains, see `SmoothedTrack`.
    """

    t: FloatArray
    q: FloatArray
    mean: FloatArray
    cov: FloatArray
    gain: FloatArray

    def at(self, t: FloatArray) -> FloatArray:
        """Sizes (T, 2), width and height (px), at times `t` (T,) (s).

        Between two keys by the cubic that the model's prior implies, beyond the ends at constant rate.
        """
        query = np.asarray(t, dtype=np.float64)
        right = np.clip(np.searchsorted(self.t, query), 1, max(len(self.t) - 1, 1))
        left = right - 1
        right = np.minimum(right, len(self.t) - 1)
        edge = np.where(query <= self.t[0], 0, len(self.t) - 1)
        outside = (query <= self.t[0]) | (query >= self.t[-1])
        span = np.where(outside, 1.0, self.t[right] - self.t[left])[:, None]
        s = np.where(outside, 0.0, (query - self.t[left]) / span[:, 0])[:, None]
        a, b = self.mean[left], self.mean[right]
        # The conditional mean of a constant-velocity (white-acceleration) prior is the cubic Hermite
        # polynomial of its two ends (Barfoot, State Estimation for Robotics, ch. 3.4).
        inside = (
            (1 + 2 * s) * (1 - s) ** 2 * a[:, :, 0]
            + s * (1 - s) ** 2 * span * a[:, :, 1]
            + s**2 * (3 - 2 * s) * b[:, :, 0]
            + s**2 * (s - 1) * span * b[:, :, 1]
        )
        beyond = self.mean[edge, :, 0] + (query - self.t[edge])[:, None] * self.mean[edge, :, 1]
        return np.asarray(np.exp(np.where(outside[:, None], beyond, inside)))


@njit(cache=True)
def _size_matrices(dt: FloatArray, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Transition (N, 2, 2) and process noise (N, 2, 2) of [ln size, rate] for steps `dt` (N,) (s)."""
    F = np.empty((len(dt), 2, 2))
    Q = np.empty((len(dt), 2, 2))
    for i in range(len(dt)):
        F[i] = size_transition(dt[i])
        Q[i] = size_process_noise(dt[i], q[i])
    return F, Q


def smooth_size(
    prior_t: float,
    prior_mean: FloatArray,
    prior_cov: FloatArray,
    t: FloatArray,
    log_size: FloatArray,
    r: FloatArray,
    q: FloatArray,
) -> SmoothedSize:
    """Smooth the sizes of one whole track (Rauch-Tung-Striebel, nearly constant rate).

    F = [[1, Δ], [0, 1]], Q = q² [[Δ³/3, Δ²/2], [Δ²/2, Δ]].

    Args:
        prior_t: time of the prior (s); it is key 0 of the result.
        prior_mean: (2, 2) for width and height [ln size, rate].
        prior_cov: (2, 2, 2) its covariance.
        t: (M,) times of the measurements (s), in any order, none before the prior.
        log_size: (M, 2) measured ln w and ln h (ln px).
        r: (M, 2) their variances.
        q: (M,) root spectral density of the rate since the measurement before (1/s^1.5).

    Returns:
        The smoothed sizes, at the keys that `TrackData` would give to the same times.

    Raises:
        DataError: if a measurement is older than the prior.
    """
    order = np.argsort(t, kind="stable")
    times = np.asarray(t, dtype=np.float64)[order]
    key, first = group_times(times, prior_t)
    if len(times) and times[0] < prior_t - COINCIDENT_S:
        raise DataError(f"a size at {times[0]} s is older than the track's prior at {prior_t} s")
    keys = np.concatenate([[prior_t], times[first]])
    density = np.concatenate([[0.0], np.asarray(q, dtype=np.float64)[order][first]])
    z, info = fuse(key, np.asarray(log_size)[order], np.asarray(r)[order], len(keys))
    F, Q = _size_matrices(np.diff(keys, prepend=prior_t), density)
    start = np.array([0, len(keys)])
    filtered = forward(F, Q, z, info, start, np.asarray(prior_mean)[None], np.asarray(prior_cov)[None])
    mean, cov, gain = backward(F, Q, start, *filtered)
    return SmoothedSize(keys, density, mean, cov, gain)
