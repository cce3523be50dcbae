"""How hard a track manoeuvres, learnt while it runs: its motion filtered under several densities of jerk.

What turns (a roundabout, players, a camera held in the hand) changes its acceleration faster than traffic
on a straight road. A filter too stiff for it lags behind and its innovations grow, and from their size
alone that cannot be told from noisy boxes. From their order it can: a lag has the same sign scan after
scan. So each track carries a few filters beside its own that differ in the density of the jerk alone, and
Bayes' rule weighs them by how well each foretold the detections. Source: autonomous multiple models, Bar-
Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, ch. 11.6.2; the weights
relax to what is usual of the scene, for manoeuvres begin and end, and the tracker itself goes by one filter
at the mean density.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.filters.coasting import forget_acceleration
from jeat_graph.filters.coloured_noise import expected, predict_errors, update_centre
from jeat_graph.filters.kalman import log_gaussian, predict

# One detection, however odd, lowers the odds of a density against the best by no more than a factor of e^3.
_MOST_EVIDENCE = 3.0
# No density is ever ruled out for the tracks to come.
_LEAST_WEIGHT = 1e-3


def prior_weights(more: float, densities: int) -> FloatArray:
    """Weights (K,) of the densities before anything is known, each `more` times the one before."""
    weight = more ** np.arange(densities, dtype=np.float64)
    return weight / weight.sum() if densities else weight


@njit(cache=True)
def mean_factor(weight: FloatArray, step: float) -> float:
    """Factor on the density of a track's jerk: the geometric mean of 1, step, step², … under the weights.

    Args:
        weight: (K,) probability of each density.
        step: factor from one density to the next, >= 1.
    """
    power = 0.0
    for k in range(len(weight)):
        power += k * weight[k]
    return math.exp(power * math.log(step))


@njit(cache=True)
def predict_manoeuvres(
    mean: FloatArray,
    cov: FloatArray,
    jerk: FloatArray,
    correlation_time: FloatArray,
    dt: float,
    unseen: BoolArray,
    memory_s: float,
) -> None:
    """Predict the filters of all tracks by `dt` seconds, in place.

    Args:
        mean: (N, K, 2, 3 + B) per density and axis [p, v, a, e_1, …].
        cov: (N, K, 2, 3 + B, 3 + B) covariance.
        jerk: (N K,) root spectral density of the jerk of each (px/s^2.5).
        correlation_time: (B,) of the errors (s).
        dt: time step (s), >= 0.
        unseen: (N K,) whether its track is unseen.
        memory_s: time constant with which its acceleration dies away then (s); 0: it stays.
    """
    n, K, D = mean.shape[0], mean.shape[1], mean.shape[3]
    m, P = mean.reshape((n * K, 2, D)), cov.reshape((n * K, 2, D, D))
    predict(m, P, jerk, dt)
    if len(correlation_time):
        predict_errors(m, P, correlation_time, dt)
    if memory_s > 0.0:
        forget_acceleration(m, P, unseen, dt, memory_s)


@njit(cache=True)
def weigh_manoeuvres(
    mean: FloatArray,
    cov: FloatArray,
    weight: FloatArray,
    z: FloatArray,
    R: FloatArray,
    coloured_std: FloatArray,
    error: int,
    whole: BoolArray,
) -> float:
    """Update the filters of one track with a detection and weigh them by how well they foretold it, in place.

    Eight arguments: those of `update_centre`, the weights, and which axes have a say.

    Args:
        mean: (K, 2, 3 + B) per density and axis.
        cov: (K, 2, 3 + B, 3 + B) covariance.
        weight: (K,) probability of each density.
        z: (2,) measured centre (px).
        R: (2,) variances of the white part (px²).
        coloured_std: (2,) standard deviation of the coloured part (px).
        error: the sensor's error state, counted from 0, or -1.
        whole: (2,) the axes along which the box is whole; where it is cut, little is measured.

    Returns:
        The normalised innovation squared, the mean over the densities: what of it no manoeuvre explains.
    """
    K = len(weight)
    fit, square, best = np.zeros(K), np.empty(K), -np.inf
    for k in range(K):
        for axis in range(2):
            if whole[axis]:
                e, V = expected(mean[k, axis], cov[k, axis], coloured_std[axis], error)
                fit[k] += log_gaussian(z[axis] - e, V + R[axis])
        best = max(best, fit[k])
        square[k] = update_centre(mean[k], cov[k], z, R, coloured_std, error)
    total, nis = 0.0, 0.0
    for k in range(K):
        weight[k] *= math.exp(max(fit[k] - best, -_MOST_EVIDENCE))
        total += weight[k]
        nis += weight[k] * square[k]
    for k in range(K):
        weight[k] /= total
    return nis / total


@njit(cache=True)
def relax_weights(weight: FloatArray, usual: FloatArray, dt: float, memory_s: float) -> None:
    """Let the weights (N, K) of the densities go back to the usual ones (K,) over `dt` seconds, in place.

    Args:
        weight: (N, K) probability of each density, for each track.
        usual: (K,) the same of the scene.
        dt: time step (s), >= 0.
        memory_s: time constant (s), > 0: how long a manoeuvre lasts.
    """
    coming = 1.0 - math.exp(-dt / memory_s)
    least = 1.0 + _LEAST_WEIGHT * len(usual)
    for i in range(weight.shape[0]):
        for k in range(len(usual)):
            weight[i, k] += coming * ((usual[k] + _LEAST_WEIGHT) / least - weight[i, k])
