"""How much of a detector's error persists from scan to scan, and for how long."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from jeat_graph.data.arrays import FloatArray, IntArray

# Lags over which the correlation is looked at; errors that last longer are a bias as far as tracks can tell.
_MAX_LAG_S = 1.5
_BINS = 24
_LEAST_PAIRS = 200
# Errors beyond this many standard deviations are outliers; they count as if they were this large.
_CLIP = 3.5
_LEAST_SHARE, _MOST_SHARE = 0.05, 0.95
_LEAST_MEMORY_S, _MOST_MEMORY_S = 0.01, 5.0


def fit_memory(error: FloatArray, key: IntArray, t: FloatArray) -> tuple[float, float]:
    """Fit the autocorrelation c exp(−Δ / τ) at lags Δ > 0 to the errors of one sensor's detections.

    At lag zero it is one: what is missing there, 1 − c, is white. (The empirical covariogram with a nugget;
    Cressie, Statistics for Spatial Data, 1993, ch. 2.)

    Args:
        error: (C, 2) errors of the centre in units of their standard deviation, bias removed.
        key: (C, 2) sequence and object of each.
        t: (C,) time (s).

    Returns:
        The share c of the variance with memory, 0 where there is none to speak of, and τ (s).
    """
    lag, product = _pairs(error, key, t)
    if len(lag) < _LEAST_PAIRS:
        return 0.0, 0.2
    edges = np.unique(np.quantile(lag, np.linspace(0.0, 1.0, _BINS + 1)))
    bin_ = np.clip(np.searchsorted(edges, lag, side="right") - 1, 0, max(len(edges) - 2, 0))
    count = np.bincount(bin_)
    used = count > 0
    centre = np.bincount(bin_, lag)[used] / count[used]
    value = np.bincount(bin_, product)[used] / count[used]
    weight = np.sqrt(count[used])

    def misfit(parameters: FloatArray) -> FloatArray:
        return np.asarray(weight * (parameters[0] * np.exp(-centre / np.exp(parameters[1])) - value))

    bounds = ([0.0, np.log(_LEAST_MEMORY_S)], [_MOST_SHARE, np.log(_MOST_MEMORY_S)])
    fits = [least_squares(misfit, [0.5, np.log(tau)], bounds=bounds) for tau in (0.05, 0.2, 1.0)]
    share, log_memory = min(fits, key=lambda fit: float(fit.cost)).x
    if share < _LEAST_SHARE or np.exp(log_memory) < 1.5 * _LEAST_MEMORY_S:
        return 0.0, 0.2
    return float(share), float(np.exp(log_memory))


def _pairs(error: FloatArray, key: IntArray, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lags (P,) (s) and normalised products (P,) of the errors of all pairs of one object within the lag."""
    order = np.lexsort((t, key[:, 1], key[:, 0]))
    u = np.clip(error[order], -_CLIP, _CLIP)
    lags, products = [np.zeros(0)], [np.zeros(0)]
    if not u.any():
        return lags[0], products[0]  # a perfect detector, or none
    u = u / np.sqrt(np.mean(u**2))
    keys, times = key[order], t[order]
    for step in range(1, len(times)):
        gap = times[step:] - times[:-step]
        near = (keys[step:] == keys[:-step]).all(axis=1) & (gap <= _MAX_LAG_S)
        if not near.any():
            break
        # Every step of a slow sensor, but of a fast one only some of the many long lags.
        if step > 10 and step % 5:
            continue
        near &= gap > 0.0
        lags.append(gap[near])
        products.append((u[step:][near] * u[:-step][near]).mean(axis=1))
    return np.concatenate(lags), np.concatenate(products)
