"""Were two tracks mixed up? What each was before a moment against what either was after it.

Where two tracks met, two pasts and two futures can be put together in two ways: as the tracker did, or the
other way round. The likelihood of each way is that of the motion model: the past's estimate, predicted over
the step in between, against the future's, which a filter that ran backward in time knows. What pasts and
futures say by themselves is the same in both ways, so that only the two joints count (the two-filter form of
smoothing: Fraser and Potter, The optimum linear smoother as a combination of two optimum linear filters, IEEE
Transactions on Automatic Control 14(4), 1969).

Errors that last are taken for independent before and after the moment, so each way is less sure of itself
than it might be.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.kalman import predict_size
from jeat_graph.smoothers.transitions import step_cov, step_mean

# A tuple of three elements, which tells the compiler that there are no error states (`transitions.py`).
_MOTION = (0, 0, 0)


class TwoSided(NamedTuple):
    """What past and future of each key of a track say of its state there, both with the key itself.

    Attributes:
        t: (K,) times of the keys (s), strictly ascending.
        jerk: (K,) root spectral density of the jerk over the interval that ends at the key (px/s^2.5).
        size_density: (K,) that of the rate of ln size (1/s^1.5).
        past_mean: (K, 2, 3) per axis [p, v, a] (px, px/s, px/s²), by all until the key.
        past_cov: (K, 2, 3, 3) its covariance.
        future_mean: (K, 2, 3) the same by all from the key on.
        future_cov: (K, 2, 3, 3) its covariance.
        past_size: (K, 2, 2) for width and height [ln size, rate] (ln px, 1/s), by all until the key.
        past_size_cov: (K, 2, 2, 2) its covariance.
        future_size: (K, 2, 2) the same by all from the key on.
        future_size_cov: (K, 2, 2, 2) its covariance.
    """

    t: FloatArray
    jerk: FloatArray
    size_density: FloatArray
    past_mean: FloatArray
    past_cov: FloatArray
    future_mean: FloatArray
    future_cov: FloatArray
    past_size: FloatArray
    past_size_cov: FloatArray
    future_size: FloatArray
    future_size_cov: FloatArray


@njit(cache=True)
def exchange_gains(a: TwoSided, b: TwoSided, t: FloatArray) -> FloatArray:
    """By how much likelier two tracks are if they changed places at a moment.

    Args:
        a: one track.
        b: the other.
        t: (C,) moments (s), none of them the time of a key.

    Returns:
        (C,) ln likelihood ratios of the exchange against none; -∞ where a track has no past or no future.
    """
    out = np.full(len(t), -np.inf)
    for c in range(len(t)):
        i, j = np.searchsorted(a.t, t[c]), np.searchsorted(b.t, t[c])
        if 0 < i < len(a.t) and 0 < j < len(b.t):
            crossed = _joint(a, i, b, j) + _joint(b, j, a, i)
            kept = _joint(a, i, a, i) + _joint(b, j, b, j)
            out[c] = crossed - kept
    return out


@njit(cache=True)
def _joint(past: TwoSided, i: int, future: TwoSided, j: int) -> float:
    """Log density with which `past`, at the key before i, goes over into `future` at key j.

    How strongly motion and size may change on the way is the past's to say: a vehicle about to pass below the
    camera is far less predictable than one that stands.
    """
    last, jerk = i - 1, past.jerk[i]
    dt = future.t[j] - past.t[last]
    mean, cov, moved, none = np.empty(3), np.empty((3, 3)), np.empty((3, 3)), np.empty(0)
    size, size_cov = past.past_size[last:i].copy(), past.past_size_cov[last:i].copy()
    predict_size(size, size_cov, past.size_density[i : i + 1], dt)
    total = 0.0
    for axis in range(2):
        step_mean(_MOTION, dt, none, past.past_mean[last, axis], mean)
        step_cov(_MOTION, dt, jerk, none, none, past.past_cov[last, axis], moved, cov)
        total += _log_density(future.future_mean[j, axis] - mean, cov + future.future_cov[j, axis])
        total += _log_density(
            future.future_size[j, axis] - size[0, axis], size_cov[0, axis] + future.future_size_cov[j, axis]
        )
    return total


@njit(cache=True)
def _log_density(error: FloatArray, S: FloatArray) -> float:
    """Log density of an error (n,) of covariance S (n, n), but for a constant; both are overwritten."""
    n = len(error)
    total = 0.0
    for r in range(n):
        for c in range(r + 1):
            rest = S[r, c]
            for k in range(c):
                rest -= S[r, k] * S[c, k]
            S[r, c] = math.sqrt(rest) if r == c else rest / S[c, c]
        rest = error[r]
        for k in range(r):
            rest -= S[r, k] * error[k]
        error[r] = rest / S[r, r]
        total -= 0.5 * error[r] * error[r] + math.log(S[r, r])
    return total
