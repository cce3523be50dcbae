"""Is a track standing still? A running comparison of two models, and the zero-velocity update it permits.

Constant acceleration with the jerk that traffic needs cannot tell a parked vehicle, seen now and then in
the dark, from one that creeps. A second model can: a point that stays where it is. Each measurement is
weighed under both, and the running log odds decide (Bar-Shalom, Li, Kirubarajan, ch. 11, the two models not
mixed but compared). While a track stands, its velocity is measured as zero after each update, as inertial
navigation does.
"""

from __future__ import annotations

from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.kalman import log_gaussian

_MOST_ODDS = 30.0


@njit(cache=True)
def still_evidence(rest_point: FloatArray, rest_var: FloatArray, z: FloatArray, R: FloatArray) -> float:
    """Log density of a measurement under the model of a point that stays.

    Args:
        rest_point: (2,) the point (px).
        rest_var: (2,) its variances (px²).
        z: (2,) measured centre (px).
        R: (2,) variances of the measurement (px²).
    """
    total = 0.0
    for axis in range(2):
        total += log_gaussian(z[axis] - rest_point[axis], rest_var[axis] + R[axis])
    return total


@njit(cache=True)
def moving_evidence(mean: FloatArray, cov: FloatArray, z: FloatArray, R: FloatArray) -> float:
    """Log density of a measurement under the motion model.

    Args:
        mean: (2, 3) predicted state per axis [p, v, a].
        cov: (2, 3, 3) its covariance.
        z: (2,) measured centre (px).
        R: (2,) variances of the measurement (px²).
    """
    total = 0.0
    for axis in range(2):
        total += log_gaussian(z[axis] - mean[axis, 0], cov[axis, 0, 0] + R[axis])
    return total


@njit(cache=True)
def update_rest_point(rest_point: FloatArray, rest_var: FloatArray, z: FloatArray, R: FloatArray) -> None:
    """Update the point that stays with a measurement, in place; arguments as in `still_evidence`."""
    for axis in range(2):
        gain = rest_var[axis] / (rest_var[axis] + R[axis])
        rest_point[axis] += gain * (z[axis] - rest_point[axis])
        rest_var[axis] *= 1.0 - gain


@njit(cache=True)
def update_odds(odds: float, still: float, moving: float, memory: float) -> float:
    """Forget a part of the log odds of standing and add the new evidence, within bounds.

    Args:
        odds: log odds before.
        still: log density under the model that stays.
        moving: log density under the motion model.
        memory: factor on the old odds, below 1.
    """
    return min(max(memory * odds + still - moving, -_MOST_ODDS), _MOST_ODDS)


@njit(cache=True)
def zero_update(m: FloatArray, P: FloatArray, k: int, std: float) -> None:
    """Take in the pseudo-measurement that component `k` of a block is zero, in place (Joseph form).

    Written out for H = e_k as in `kalman.update_block`, so that no variance is a difference of large numbers.

    Args:
        m: (D,) mean.
        P: (D, D) covariance, symmetric.
        k: the component.
        std: standard deviation of the pseudo-measurement, > 0.
    """
    R = std * std
    S = P[k, k] + R
    row = P[k].copy()
    K = row / S
    kept = R / S
    y = -m[k]
    for i in range(len(m)):
        m[i] += K[i] * y
        for j in range(i, len(m)):
            if i == k or j == k:
                P[i, j] = row[i + j - k] * kept
            else:
                P[i, j] -= K[i] * row[j]
            P[j, i] = P[i, j]


@njit(cache=True)
def stand_still(
    mean: FloatArray,
    cov: FloatArray,
    size_mean: FloatArray,
    size_cov: FloatArray,
    rate_std: float,
    size: float,
) -> None:
    """Take in that a track neither moves nor grows, in place.

    Args:
        mean: (2, 3) per axis [p, v, a].
        cov: (2, 3, 3).
        size_mean: (2, 2) ln width and ln height with their rates.
        size_cov: (2, 2, 2).
        rate_std: standard deviation of the velocity in box sizes a second, of the acceleration in box sizes a
            second squared, and of the rate of growth (1/s).
        size: box size (px).
    """
    for axis in range(2):
        zero_update(mean[axis], cov[axis], 1, rate_std * size)
        zero_update(mean[axis], cov[axis], 2, rate_std * size)
        zero_update(size_mean[axis], size_cov[axis], 1, rate_std)
