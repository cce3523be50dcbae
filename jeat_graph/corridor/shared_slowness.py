"""The slowness of a gap that vehicles share: how much longer all of them take than their speeds say.

An Ornstein–Uhlenbeck process θ of time, with standard deviation σ and correlation time τ, seen in the
residuals of ln travel time. Its posterior is that of a Kalman filter and a Rauch–Tung–Striebel pass; σ and τ
are those of a few that predict the residuals best, each from those before it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray

#: Standard deviations (of ln travel time) and correlation times (s) that are tried; 0: no such process.
_SIGMAS = (0.01, 0.03, 0.1, 0.3)
_TIMES_S = (15.0, 60.0, 240.0)
_NONE = (0.0, 60.0)
_LEAST_WEIGHT = 1e-6


class Slowness(NamedTuple):
    """A smoothed process at N times.

    Attributes:
        mean: (N,) of θ.
        sigma: of the process.
        time_s: its correlation time.
    """

    mean: FloatArray
    sigma: float
    time_s: float


def shared_slowness(t: FloatArray, value: FloatArray, variance: FloatArray) -> Slowness:
    """Estimate the process at the times of its observations.

    Args:
        t: (N,) times in order (s).
        value: (N,) residuals.
        variance: (N,) of their noise, infinity where nothing was seen.
    """
    seen = np.isfinite(variance)
    if seen.sum() < 2:
        return Slowness(np.zeros(len(t)), *_NONE)
    tried = [_NONE, *((sigma, time_s) for sigma in _SIGMAS for time_s in _TIMES_S)]
    likelihoods = [_filtered(t, value, variance, *one)[0] for one in tried]
    best = tried[int(np.argmax(likelihoods))]
    if best == _NONE:
        return Slowness(np.zeros(len(t)), *_NONE)
    return Slowness(smoothed(t, value, variance, *best), *best)


def by_lane(
    t: FloatArray, lane: IntArray, value: FloatArray, variance: FloatArray
) -> tuple[FloatArray, Slowness]:
    """Estimate what all lanes share, and then of each lane what it has of its own.

    Args:
        t: (N,) times in order (s).
        lane: (N,) lanes, −1 where unknown.
        value: (N,) residuals.
        variance: (N,) of their noise.

    Returns:
        The sum (N,) of both, and what all lanes share.
    """
    common = shared_slowness(t, value, variance)
    out = common.mean.copy()
    lanes = np.unique(lane[lane >= 0])
    if len(lanes) > 1:
        for one in lanes:
            rows = np.flatnonzero(lane == one)
            out[rows] += shared_slowness(t[rows], value[rows] - common.mean[rows], variance[rows]).mean
    return out, common


def smoothed(
    t: FloatArray, value: FloatArray, variance: FloatArray, sigma: float, time_s: float
) -> FloatArray:
    """Return the posterior mean (N,) of the process."""
    # In Python's own numbers: element by element, arrays are slow.
    _, mean, var, keep = _filtered(t, value, variance, sigma, time_s)
    for k in range(len(t) - 2, -1, -1):
        predicted = keep[k + 1] ** 2 * var[k] + sigma**2 * (1.0 - keep[k + 1] ** 2)
        gain = keep[k + 1] * var[k] / predicted if predicted > 0.0 else 0.0
        mean[k] += gain * (mean[k + 1] - keep[k + 1] * mean[k])
    return np.array(mean, dtype=np.float64)


def _filtered(
    t: FloatArray, value: FloatArray, variance: FloatArray, sigma: float, time_s: float
) -> tuple[float, list[float], list[float], list[float]]:
    """Log likelihood of the observations; filtered means and variances (N,); correlations (N,)."""
    keep: list[float] = np.exp(-np.diff(t, prepend=t[:1]) / time_s).tolist()
    mean, var = [], []
    m, p, total = 0.0, sigma**2, 0.0
    for held, seen, noise in zip(keep, value.tolist(), variance.tolist(), strict=True):
        m *= held
        p = held**2 * p + sigma**2 * (1.0 - held**2)
        if noise < math.inf:
            s = p + noise
            y = seen - m
            total -= 0.5 * (y * y / s + math.log(s))
            m += p / s * y
            p *= noise / s
        mean.append(m)
        var.append(p)
    return total, mean, var, keep


def pooled(
    row: IntArray, value: FloatArray, variance: FloatArray, weight: FloatArray, rows: int
) -> tuple[FloatArray, FloatArray]:
    """Make one observation of each row of its weighed ones.

    Args:
        row: (E,) which row.
        value: (E,) residuals.
        variance: (E,) of their noise.
        weight: (E,) probabilities.
        rows: N.

    Returns:
        Values and variances (N,), infinity where nothing was seen.
    """
    precision = np.bincount(row, weight / variance, rows)
    total = np.bincount(row, weight * value / variance, rows)
    seen = precision > _LEAST_WEIGHT
    safe = np.where(seen, precision, 1.0)
    return np.where(seen, total / safe, 0.0), np.where(seen, 1.0 / safe, np.inf)
