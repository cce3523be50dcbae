"""Smoothing of a box's size: ln w and ln h, each with a rate that drifts, apart from the motion."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.smoothers.measurements import COINCIDENT_S


@dataclass(frozen=True, eq=False)
class SmoothedSize:
    """Smoothed sizes of one track.

    Attributes:
        t: (K,) times (s), ascending.
        rate_density: (K,) root spectral density of the rate over the interval that ends there (1/s^1.5); of
            the first key, over the time before it.
        mean: (K, 2, 2) for width and height, [ln size, rate] (ln px, 1/s).
        cov: (K, 2, 2, 2) covariances.
        cross: (K, 2, 2, 2) covariance of each key with the next; of the last, nothing.
    """

    t: FloatArray
    rate_density: FloatArray
    mean: FloatArray
    cov: FloatArray
    cross: FloatArray

    def at(self, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Sizes at times `t` (T,) (s).

        Between two keys as the model's prior implies, beyond the ends at constant rate.

        Returns:
            (T, 2) width and height (px), and (T, 2) the variances of their logarithms.
        """
        query = np.asarray(t, dtype=np.float64)
        return _sizes_at(self.t, self.rate_density, self.mean, self.cov, self.cross, query)


@njit(cache=True)
def _sizes_at(
    t: FloatArray,
    rate_density: FloatArray,
    mean: FloatArray,
    cov: FloatArray,
    cross: FloatArray,
    query: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """`SmoothedSize.at`."""
    out, var = np.empty((len(query), 2)), np.empty((len(query), 2))
    last, right = len(t) - 1, 0
    for i in range(len(query)):
        if right > last or t[right] < query[i] or (right > 0 and t[right - 1] >= query[i]):
            right = np.searchsorted(t, query[i])
        if query[i] <= t[0] or query[i] >= t[last]:
            edge = 0 if query[i] <= t[0] else last
            d = query[i] - t[edge]
            grown = rate_density[edge] * rate_density[edge] * abs(d * d * d) / 3.0
            for axis in range(2):
                out[i, axis] = math.exp(mean[edge, axis, 0] + d * mean[edge, axis, 1])
                C = cov[edge, axis]
                var[i, axis] = C[0, 0] + 2.0 * d * C[0, 1] + d * d * C[1, 1] + grown
            continue
        span = t[right] - t[right - 1]
        s = (query[i] - t[right - 1]) / span
        # The conditional mean of a constant-velocity (white-acceleration) prior is the cubic Hermite
        # polynomial of its two ends (Barfoot, State Estimation for Robotics, ch. 3.4); about it the size
        # varies by as much as an integrated random walk does that is held at both.
        a0, a1 = (1 + 2 * s) * (1 - s) * (1 - s), s * (1 - s) * (1 - s) * span
        b0, b1 = s * s * (3 - 2 * s), s * s * (s - 1) * span
        arc = span * s * (1 - s)
        free = rate_density[right] * rate_density[right] * arc * arc * arc / 3.0
        for axis in range(2):
            a, b = mean[right - 1, axis], mean[right, axis]
            out[i, axis] = math.exp(a0 * a[0] + a1 * a[1] + b0 * b[0] + b1 * b[1])
            A, B, C = cov[right - 1, axis], cov[right, axis], cross[right - 1, axis]
            ends = a0 * a0 * A[0, 0] + 2.0 * a0 * a1 * A[0, 1] + a1 * a1 * A[1, 1]
            ends += b0 * b0 * B[0, 0] + 2.0 * b0 * b1 * B[0, 1] + b1 * b1 * B[1, 1]
            between = a0 * (C[0, 0] * b0 + C[0, 1] * b1) + a1 * (C[1, 0] * b0 + C[1, 1] * b1)
            var[i, axis] = ends + 2.0 * between + free
    return out, var


@njit(cache=True)
def _filter(
    prior_t: float,
    prior_mean: FloatArray,
    prior_cov: FloatArray,
    times: FloatArray,
    z: FloatArray,
    r: FloatArray,
    drift: FloatArray,
    prior_drift: float,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Filter [ln size, rate]; see `smooth_size`, whose measurements are in order of time here."""
    t, rate_density = np.empty(len(times) + 1), np.empty(len(times) + 1)
    key = np.empty(len(times), dtype=np.int64)
    t[0], rate_density[0], keys = prior_t, prior_drift, 1
    for i in range(len(times)):
        if times[i] - t[keys - 1] > COINCIDENT_S:
            t[keys], rate_density[keys] = times[i], drift[i]
            keys += 1
        key[i] = keys - 1
    mean, cov = np.empty((keys, 2, 2)), np.empty((keys, 2, 2, 2))
    ahead = np.empty((keys, 2, 3))  # predicted covariances: of the size, with the rate, of the rate
    for axis in range(2):
        i = 0
        for k in range(keys):
            if k == 0:
                m, v = prior_mean[axis, 0], prior_mean[axis, 1]
                a, b, c = prior_cov[axis, 0, 0], prior_cov[axis, 0, 1], prior_cov[axis, 1, 1]
            else:
                d, s = t[k] - t[k - 1], rate_density[k] * rate_density[k]
                m += d * v
                a += d * (2.0 * b + d * c) + s * d * d * d / 3.0
                b += d * c + 0.5 * s * d * d
                c += s * d
            ahead[k, axis, 0], ahead[k, axis, 1], ahead[k, axis, 2] = a, b, c
            while i < len(key) and key[i] == k:
                S = a + r[i, axis]
                K0, K1 = a / S, b / S
                y = z[i, axis] - m
                m, v = m + K0 * y, v + K1 * y
                # Joseph form, which no rounding makes indefinite.
                c += K1 * (K1 * S - 2.0 * b)
                b = (1.0 - K0) * (b - K1 * a) + K0 * K1 * r[i, axis]
                a = (1.0 - K0) * (1.0 - K0) * a + K0 * K0 * r[i, axis]
                i += 1
            mean[k, axis, 0], mean[k, axis, 1] = m, v
            cov[k, axis, 0, 0], cov[k, axis, 0, 1], cov[k, axis, 1, 0], cov[k, axis, 1, 1] = a, b, b, c
    return t[:keys], rate_density[:keys], mean, cov, ahead


@njit(cache=True)
def _smooth_back(t: FloatArray, mean: FloatArray, cov: FloatArray, ahead: FloatArray) -> FloatArray:
    """Smooth what `_filter` gave, in place; return the covariances of each key with the next (K, 2, 2, 2)."""
    keys = len(t)
    cross = np.zeros((keys, 2, 2, 2))
    for axis in range(2):
        for k in range(keys - 2, -1, -1):
            d = t[k + 1] - t[k]
            P, A = cov[k, axis], ahead[k + 1, axis]
            det = A[0] * A[2] - A[1] * A[1]
            # G = P Fᵀ A⁻¹
            f00, f01, f10, f11 = P[0, 0] + d * P[0, 1], P[0, 1], P[0, 1] + d * P[1, 1], P[1, 1]
            g00, g01 = (f00 * A[2] - f01 * A[1]) / det, (f01 * A[0] - f00 * A[1]) / det
            g10, g11 = (f10 * A[2] - f11 * A[1]) / det, (f11 * A[0] - f10 * A[1]) / det
            e0 = mean[k + 1, axis, 0] - mean[k, axis, 0] - d * mean[k, axis, 1]
            e1 = mean[k + 1, axis, 1] - mean[k, axis, 1]
            mean[k, axis, 0] += g00 * e0 + g01 * e1
            mean[k, axis, 1] += g10 * e0 + g11 * e1
            N = cov[k + 1, axis]
            cross[k, axis, 0, 0] = g00 * N[0, 0] + g01 * N[1, 0]
            cross[k, axis, 0, 1] = g00 * N[0, 1] + g01 * N[1, 1]
            cross[k, axis, 1, 0] = g10 * N[0, 0] + g11 * N[1, 0]
            cross[k, axis, 1, 1] = g10 * N[0, 1] + g11 * N[1, 1]
            D0 = cov[k + 1, axis, 0, 0] - A[0]
            D1 = cov[k + 1, axis, 0, 1] - A[1]
            D2 = cov[k + 1, axis, 1, 1] - A[2]
            P[0, 0] += g00 * (g00 * D0 + g01 * D1) + g01 * (g00 * D1 + g01 * D2)
            P[0, 1] += g10 * (g00 * D0 + g01 * D1) + g11 * (g00 * D1 + g01 * D2)
            P[1, 0] = P[0, 1]
            P[1, 1] += g10 * (g10 * D0 + g11 * D1) + g11 * (g10 * D1 + g11 * D2)
    return cross


def smooth_size(
    prior_t: float,
    prior_mean: FloatArray,
    prior_cov: FloatArray,
    t: FloatArray,
    log_size: FloatArray,
    r: FloatArray,
    rate_density: FloatArray,
    prior_density: float,
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
        rate_density: (M,) root spectral density of the rate since the measurement before (1/s^1.5).
        prior_density: that of the time before the prior, and after it where there is no measurement.

    Returns:
        The smoothed sizes, at the keys that `TrackData` would give to the same times.

    Raises:
        DataError: if a measurement is older than the prior.
    """
    times, z, var, drift = t, log_size, r, rate_density
    if np.any(times[1:] < times[:-1]):
        order = np.argsort(times, kind="stable")
        times, z, var, drift = times[order], z[order], var[order], drift[order]
    if len(times) and times[0] < prior_t - COINCIDENT_S:
        raise DataError(f"a size at {times[0]} s is older than the track's prior at {prior_t} s")
    prior = float(prior_t), prior_mean, prior_cov
    keys, density, mean, cov, ahead = _filter(*prior, times, z, var, drift, float(prior_density))
    cross = _smooth_back(keys, mean, cov, ahead)
    return SmoothedSize(keys, density, mean, cov, cross)


def filter_size(
    prior_mean: FloatArray,
    prior_cov: FloatArray,
    t: FloatArray,
    log_size: FloatArray,
    r: FloatArray,
    density: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Filter the sizes of one track, whose first measurement is its prior.

    Args:
        prior_mean: (2, 2) for width and height [ln size, rate] at the first measurement.
        prior_cov: (2, 2, 2) its covariance.
        t: (M,) times of the measurements (s), ascending.
        log_size: (M, 2) measured ln w and ln h (ln px).
        r: (M, 2) their variances.
        density: (M,) root spectral density of the rate since the measurement before (1/s^1.5).

    Returns:
        (K,) densities of the keys, which are as `TrackData` has them, and (K, 2, 2) means and (K, 2, 2, 2)
        covariances by all until each.
    """
    later = t[1:], log_size[1:], r[1:], density[1:]
    _, keys, mean, cov, _ = _filter(float(t[0]), prior_mean, prior_cov, *later, float(density[0]))
    return keys, mean, cov
