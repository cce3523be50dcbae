"""How hard a track manoeuvres, learnt while it runs: its motion filtered under three densities of jerk.

What turns (a roundabout, players, a camera held in the hand) changes its acceleration faster than traffic
on a straight road, and a walker who goes straight on changes it less. A filter too stiff lags behind and its
innovations grow, and from their size alone that cannot be told from noisy boxes. From their order it can: a
lag has the same sign scan after scan. A filter too loose follows the errors of the boxes, and takes the box
of whoever comes by for that of a track it has lost sight of. So each track carries three filters beside its
own that differ in the density of the jerk alone: a calm one, the usual one, that of a manoeuvre; and
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


def prior_weights(calm: float, harder: float) -> FloatArray:
    """Weights (3,) of the densities before anything is known, in the order of `density_factor`.

    Args:
        calm: odds of the calm one against the usual one.
        harder: odds of a manoeuvre, likewise.
    """
    weight: FloatArray = np.array([calm, 1.0, harder]) / (calm + 1.0 + harder)
    return weight


@njit(cache=True)
def density_factor(k: int, calmer: float, harder: float) -> float:
    """Factor of density `k` on the usual one: calm, usual, a manoeuvre.

    Args:
        k: from 0.
        calmer: how many times calmer than usual the first is, >= 1.
        harder: how many times harder than usual the last is, >= 1.
    """
    if k == 1:
        return 1.0
    return 1.0 / calmer if k == 0 else harder


@njit(cache=True)
def mean_factor(weight: FloatArray, calmer: float, harder: float) -> float:
    """Factor on the density of a track's jerk: the geometric mean of the factors under the weights.

    Args:
        weight: (3,) probability of each density.
        calmer: as in `density_factor`.
        harder: as there.
    """
    return math.exp(weight[2] * math.log(harder) - weight[0] * math.log(calmer))


@njit(cache=True)
def weigh(weight: FloatArray, fit: FloatArray) -> None:
    """Weigh densities by how well each foretold one detection (Bayes' rule), in place.

    Args:
        weight: (K,) probability of each.
        fit: (K,) log density of the detection under each.
    """
    best, total = np.max(fit), 0.0
    for k in range(len(weight)):
        weight[k] *= math.exp(max(fit[k] - best, -_MOST_EVIDENCE))
        total += weight[k]
    for k in range(len(weight)):
        weight[k] /= total


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
    say: FloatArray,
) -> tuple[float, float]:
    """Update the filters of one track with a detection and weigh them by how well they foretold it, in place.

    Noise may be assumed to be wide, for association. Beside it the calmest motion explains everything, so
    that one has to do better than the usual one beside noise as it is; a manoeuvre, as it is assumed.
    Eight arguments: those of `update_centre`, the weights, and what the axes have to say.

    Args:
        mean: (3, 2, 3 + B) per density and axis.
        cov: (3, 2, 3 + B, 3 + B) covariance.
        weight: (3,) probability of each density.
        z: (2,) measured centre (px).
        R: (2,) variances of the white part (px²).
        coloured_std: (2,) standard deviation of the coloured part (px).
        error: the sensor's error state, counted from 0, or -1.
        say: (2,) how many times smaller than expected the squares of innovations usually are along each axis;
            0 where the box is cut, and little is measured.

    Returns:
        The normalised innovation squared, the mean over the densities: what of it no manoeuvre explains; and
        that of the usual density.
    """
    K = len(weight)
    fit, square, calm = np.zeros(K), np.empty(K), 0.0
    for k in range(K):
        for axis in range(2):
            if say[axis] > 0.0:
                e, V = expected(mean[k, axis], cov[k, axis], coloured_std[axis], error)
                fit[k] += log_gaussian(z[axis] - e, V + R[axis])
                if k < 2:
                    sign = 1.0 if k == 0 else -1.0
                    calm += sign * log_gaussian(z[axis] - e, (V + R[axis]) / say[axis])
        square[k] = update_centre(mean[k], cov[k], z, R, coloured_std, error)
    fit[0] = fit[1] + calm
    weigh(weight, fit)
    nis = 0.0
    for k in range(K):
        nis += weight[k] * square[k]
    return nis, square[1]


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
