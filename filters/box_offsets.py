"""What each sensor's boxes are off by, learnt from vehicles that several sensors see.

Detectors do not agree about where a vehicle ends: one draws its boxes a third larger than another, or always
a little too far to the left. Nobody tells a tracker the truth, but two boxes of one vehicle tell the
difference. Along each axis sensor s is taken to be off by

    centre: b_s · side + c_s,    ln side: d_s,

and a pair of boxes of sensors s and o measures (b_s − b_o) · side + (c_s − c_o), and d_s − d_o, with
noise. That is linear regression with normal priors of mean 0 (Lindley, Smith, "Bayes estimates for the
linear model", JRSS B 34(1), 1972): the sums that it needs are kept, older pairs count less, and the
solution is that of all pairs at once. Differences do not say who is right; the priors do: who may be
off by more is corrected by more. Of a sensor that is alone nothing is learnt, and its boxes stay.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray

#: Sums kept of each pair of sensors and axis: with weights p of centres, Σ p a², Σ p a, Σ p, Σ p a e, Σ p e,
#: Σ p e² over differences e of centres at sides a; with weights q of sizes, Σ q, Σ q f, Σ q f² over
#: differences f of ln side; and over how much that is, in seconds of a track.
NUM_SUMS = 10


@njit(cache=True)
def add_pair(
    sums: FloatArray, side: float, centre: float, p: float, log_size: float, q: float, seconds: float
) -> None:
    """Take in what two boxes of one vehicle differ by along one axis, in place.

    Args:
        sums: (10,) of these two sensors and this axis.
        side: width or height of the vehicle (px).
        centre: difference of the centres (px).
        p: its weight, over the variance that is assumed of it (1/px²).
        log_size: difference of the ln side.
        q: its weight, over the variance that is assumed of it.
        seconds: how much of a track the pair stands for (s).
    """
    sums[0] += p * side * side
    sums[1] += p * side
    sums[2] += p
    sums[3] += p * side * centre
    sums[4] += p * centre
    sums[5] += p * centre * centre
    sums[6] += q
    sums[7] += q * log_size
    sums[8] += q * log_size * log_size
    sums[9] += seconds


class PairTerms(NamedTuple):
    """On what terms the boxes of two sensors are compared.

    Attributes:
        sign: 1, or −1 where the difference that is kept is that of the other less the one.
        centre_var: variance of the difference of their centres that does not depend on size (px²);
        centre_var_x: the part that goes with the square of the width,
        centre_var_y: with that of the height,
        centre_var_size: and with the area.
        width_var: variance of the difference of ln width,
        height_var: and of ln height.
        seconds: how much of a track a pair stands for (s).
        freedom: degrees of freedom of Student's t for pairs that do not fit.
    """

    sign: float
    centre_var: float
    centre_var_x: float
    centre_var_y: float
    centre_var_size: float
    width_var: float
    height_var: float
    seconds: float
    freedom: float


@njit(cache=True)
def compare_boxes(
    own: FloatArray,
    other: FloatArray,
    mean: FloatArray,
    size_mean: FloatArray,
    known: FloatArray,
    factors: FloatArray,
    terms: PairTerms,
    sums: FloatArray,
) -> None:
    """Take in what two boxes of one track differ by, in place.

    Args:
        own: (5,) time (s), centre (px), ln width, ln height of a box;
        other: (5,) the same of one that came before, of another sensor.
        mean: (2, 3 + B) motion of the track by axis; with its velocity the other is brought to the same time,
        size_mean: (2, 2) and with the rates of its ln width and ln height.
        known: (2, 3) b, c, d of the sensor of the one less those of the other, times the sign.
        factors: (2, 2) on the variances (`noise_factors`).
        terms: of the comparison.
        sums: (2, 10) of the two sensors (`add_pair`).
    """
    age = own[0] - other[0]
    place_x, place_y = other[1] + age * mean[0, 1], other[2] + age * mean[1, 1]
    width, height = other[3] + age * size_mean[0, 1], other[4] + age * size_mean[1, 1]
    x, y = terms.sign * (own[1] - place_x), terms.sign * (own[2] - place_y)
    f, g = terms.sign * (own[3] - width), terms.sign * (own[4] - height)
    side_x, side_y = math.exp(0.5 * (own[3] + width)), math.exp(0.5 * (own[4] + height))
    var = terms.centre_var + terms.centre_var_size * side_x * side_y
    var_x, var_y = var + terms.centre_var_x * side_x * side_x, var + terms.centre_var_y * side_y * side_y
    rest_x, rest_y = x - known[0, 0] * side_x - known[0, 1], y - known[1, 0] * side_y - known[1, 1]
    rest_f, rest_g = f - known[0, 2], g - known[1, 2]
    distance = rest_x * rest_x / (var_x * factors[0, 0]) + rest_y * rest_y / (var_y * factors[1, 0])
    distance += rest_f * rest_f / (terms.width_var * factors[0, 1])
    distance += rest_g * rest_g / (terms.height_var * factors[1, 1])
    weight = terms.seconds * tail_weight(distance, 4, terms.freedom)
    add_pair(sums[0], side_x, x, weight / var_x, f, weight / terms.width_var, terms.seconds)
    add_pair(sums[1], side_y, y, weight / var_y, g, weight / terms.height_var, terms.seconds)


@njit(cache=True)
def noise_factors(sums: FloatArray, difference: FloatArray, prior_s: float) -> tuple[float, float]:
    """How much larger the variances of the differences are than was assumed, of centres and of ln sides.

    With an inverse gamma prior around 1 the regression's residual sum of squares says it; smaller than was
    assumed they are not taken to be.

    Args:
        sums: (10,) of two sensors and an axis.
        difference: (3,) b, c and d of the one less those of the other, as they are known.
        prior_s: weight of the prior, in seconds of a track.
    """
    b, c, d = difference
    centre = sums[5] - 2.0 * (b * sums[3] + c * sums[4])
    centre += b * b * sums[0] + 2.0 * b * c * sums[1] + c * c * sums[2]
    size = sums[8] - 2.0 * d * sums[7] + d * d * sums[6]
    weight = prior_s + sums[9]
    return max((prior_s + centre) / weight, 1.0), max((prior_s + size) / weight, 1.0)


@njit(cache=True)
def tail_weight(distance: float, dims: int, freedom: float) -> float:
    """Weight of a pair whose differences have this squared distance d² from what is expected.

    That of Student's t, (ν + p) / (ν + d²): two boxes of two vehicles teach little (Lange, Little, Taylor,
    "Robust statistical modeling using the t distribution", JASA 84, 1989).
    """
    return (freedom + dims) / (freedom + distance)


@njit(cache=True)
def solve_offsets(sums: FloatArray, factors: FloatArray, std: FloatArray, offsets: FloatArray) -> None:
    """Find what the sensors are off by, in place.

    Args:
        sums: (S, S, 2, 10) of the pairs of a sensor and a later one, by axis (`add_pair`).
        factors: (S, S, 2, 2) on the variances that were assumed of their centres and ln sides.
        std: (S, 3) prior standard deviations of b, c (px), d; 0 for a sensor that is never off.
        offsets: (S, 2, 3) becomes b, c and d of each sensor and axis.
    """
    S = len(std)
    matrix, right = np.zeros((2 * S, 2 * S)), np.zeros(2 * S)
    sizes, size_right = np.zeros((S, S)), np.zeros(S)
    centre_std, size_std = std[:, :2].copy().reshape(-1), std[:, 2].copy()
    for axis in range(2):
        matrix[:] = 0.0
        right[:] = 0.0
        sizes[:] = 0.0
        size_right[:] = 0.0
        for s in range(S):
            for o in range(s + 1, S):
                one = sums[s, o, axis]
                p, q = 1.0 / factors[s, o, axis, 0], 1.0 / factors[s, o, axis, 1]
                for k in range(2):
                    for m in range(2):
                        _difference(matrix, 2 * s + k, 2 * s + m, 2 * o + k, 2 * o + m, p * one[k + m])
                    right[2 * s + k] += p * one[3 + k]
                    right[2 * o + k] -= p * one[3 + k]
                _difference(sizes, s, s, o, o, q * one[6])
                size_right[s] += q * one[7]
                size_right[o] -= q * one[7]
        posterior(matrix, right, centre_std)
        posterior(sizes, size_right, size_std)
        for s in range(S):
            offsets[s, axis, 0], offsets[s, axis, 1] = right[2 * s], right[2 * s + 1]
            offsets[s, axis, 2] = size_right[s]


@njit(cache=True)
def _difference(matrix: FloatArray, s: int, t: int, o: int, u: int, value: float) -> None:
    """Add `value` times (e_s − e_o)(e_t − e_u)ᵀ, in place."""
    matrix[s, t] += value
    matrix[o, u] += value
    matrix[s, u] -= value
    matrix[o, t] -= value


@njit(cache=True)
def posterior(precision: FloatArray, right: FloatArray, std: FloatArray) -> None:
    """Turn the precision of the data and their right side into posterior covariance and mean, in place.

    With D = diag(std), (Λ + D⁻²)⁻¹ = D (I + D Λ D)⁻¹ D: nothing is divided by a prior of 0, and what is
    inverted has no eigenvalue below 1.

    Args:
        precision: (K, K) Λ, becomes the covariance.
        right: (K,) becomes the mean.
        std: (K,) prior standard deviations, about 0.
    """
    n = len(std)
    for i in range(n):
        for j in range(n):
            precision[i, j] *= std[i] * std[j]
        precision[i, i] += 1.0
    # Gauss-Jordan without a search for pivots, which a matrix like that does not need.
    for k in range(n):
        pivot = 1.0 / precision[k, k]
        precision[k, k] = 1.0
        for j in range(n):
            precision[k, j] *= pivot
        for i in range(n):
            if i == k:
                continue
            factor = precision[i, k]
            precision[i, k] = 0.0
            for j in range(n):
                precision[i, j] -= factor * precision[k, j]
    mean = np.zeros(n)
    for i in range(n):
        for j in range(n):
            precision[i, j] *= std[i] * std[j]
            mean[i] += precision[i, j] * right[j]
    right[:] = mean
