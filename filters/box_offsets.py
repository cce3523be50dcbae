"""What each sensor's boxes are off by, learnt from vehicles that several sensors see.

Detectors do not agree about where a vehicle ends: one draws its boxes a third larger than another, or always
a little too far to the left. Nobody tells a tracker the truth, but two boxes of one vehicle tell the
difference. Along each axis sensor s is taken to be off by

    centre: b_s · side + c_s + e_s · (place − m) + τ_s · velocity,    ln side: d_s,

where place is the vehicle's in the picture, (x, y), and m is where vehicles have been on average: two
cameras side by side lie over one another as far as somebody registered them, here better, there worse. Boxes
that are older than their time says lie behind, by more of what is faster; that is told apart from the rest
(`lags_of`) and not taken off: it is the clock that wants to be set (`sensors.*.latency_s`). A pair of boxes
of sensors s and o measures the difference of the two, with noise. That is linear regression with normal
priors of mean 0 (Lindley, Smith, "Bayes estimates for the linear model", JRSS B 34(1), 1972): the sums that
it needs are kept, older pairs count less, and the solution is that of all pairs at once. Differences do not
say who is right; the priors do: who may be off by more is corrected by more. Of a sensor that is alone
nothing is learnt, and its boxes stay.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.regression import posterior

#: What a centre is off by is linear in: the side, 1, the place along both axes, and the velocity.
NUM_TERMS = 5
#: Sums kept of each pair of sensors and axis: with weights p of centres, Σ p a aᵀ by rows, Σ p a r and Σ p r²
#: over differences r of centres where the terms are a; with weights q of sizes, Σ q, Σ q f, Σ q f² over
#: differences f of ln side; and over how much that is, in seconds of a track.
NUM_SUMS = 35
_RIGHT, _SQUARE, _SIZE, _SECONDS = 25, 30, 31, 34


@njit(cache=True)
def add_pair(
    sums: FloatArray, terms: FloatArray, centre: float, p: float, log_size: float, q: float, seconds: float
) -> None:
    """Take in what two boxes of one vehicle differ by along one axis, in place.

    Args:
        sums: (35,) of these two sensors and this axis.
        terms: (5,) width or height of the vehicle (px), 1, its place (px), its velocity along it (px/s).
        centre: difference of the centres (px).
        p: its weight, over the variance that is assumed of it (1/px²).
        log_size: difference of the ln side.
        q: its weight, over the variance that is assumed of it.
        seconds: how much of a track the pair stands for (s).
    """
    for k in range(NUM_TERMS):
        for m in range(NUM_TERMS):
            sums[NUM_TERMS * k + m] += p * terms[k] * terms[m]
        sums[_RIGHT + k] += p * terms[k] * centre
    sums[_SQUARE] += p * centre * centre
    sums[_SIZE] += q
    sums[_SIZE + 1] += q * log_size
    sums[_SIZE + 2] += q * log_size * log_size
    sums[_SECONDS] += seconds


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
def centre_offset(offset: FloatArray, side: float, x: float, y: float) -> float:
    """What the centre of a box is off by along an axis (px).

    Args:
        offset: (6,) of its sensor and the axis (`solve_offsets`).
        side: width or height of the vehicle (px).
        x: where it is in the picture (px),
        y: along both axes.
    """
    return float(offset[0] * side + offset[1] + offset[3] * x + offset[4] * y)


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
        known: (2, 6) what the sensor of the one is off by, less that of the other, times the sign.
        factors: (2, 2) on the variances (`noise_factors`).
        terms: of the comparison.
        sums: (2, 35) of the two sensors (`add_pair`).
    """
    age = own[0] - other[0]
    place_x, place_y = other[1] + age * mean[0, 1], other[2] + age * mean[1, 1]
    width, height = other[3] + age * size_mean[0, 1], other[4] + age * size_mean[1, 1]
    x, y = terms.sign * (own[1] - place_x), terms.sign * (own[2] - place_y)
    f, g = terms.sign * (own[3] - width), terms.sign * (own[4] - height)
    side_x, side_y = math.exp(0.5 * (own[3] + width)), math.exp(0.5 * (own[4] + height))
    var = terms.centre_var + terms.centre_var_size * side_x * side_y
    var_x, var_y = var + terms.centre_var_x * side_x * side_x, var + terms.centre_var_y * side_y * side_y
    at_x, at_y = 0.5 * (own[1] + place_x), 0.5 * (own[2] + place_y)
    rest_x = x - centre_offset(known[0], side_x, at_x, at_y) - known[0, 5] * mean[0, 1]
    rest_y = y - centre_offset(known[1], side_y, at_x, at_y) - known[1, 5] * mean[1, 1]
    rest_f, rest_g = f - known[0, 2], g - known[1, 2]
    distance = rest_x * rest_x / (var_x * factors[0, 0]) + rest_y * rest_y / (var_y * factors[1, 0])
    distance += rest_f * rest_f / (terms.width_var * factors[0, 1])
    distance += rest_g * rest_g / (terms.height_var * factors[1, 1])
    weight = terms.seconds * tail_weight(distance, 4, terms.freedom)
    linear = np.array([side_x, 1.0, at_x, at_y, mean[0, 1]])
    add_pair(sums[0], linear, x, weight / var_x, f, weight / terms.width_var, terms.seconds)
    linear[0], linear[4] = side_y, mean[1, 1]
    add_pair(sums[1], linear, y, weight / var_y, g, weight / terms.height_var, terms.seconds)


@njit(cache=True)
def noise_factors(sums: FloatArray, difference: FloatArray, prior_s: float) -> tuple[float, float]:
    """How much larger the variances of the differences are than was assumed, of centres and of ln sides.

    With an inverse gamma prior around 1 the regression's residual sum of squares says it; smaller than was
    assumed they are not taken to be.

    Args:
        sums: (35,) of two sensors and an axis.
        difference: (6,) what the one is off by, less the other, as it is known (`solve_offsets`).
        prior_s: weight of the prior, in seconds of a track.
    """
    size = difference[2]
    off = np.array([difference[0], difference[1], difference[3], difference[4], difference[5]])
    centre = sums[_SQUARE]
    for k in range(NUM_TERMS):
        centre -= 2.0 * off[k] * sums[_RIGHT + k]
        for m in range(NUM_TERMS):
            centre += off[k] * off[m] * sums[NUM_TERMS * k + m]
    rest = sums[_SIZE + 2] - 2.0 * size * sums[_SIZE + 1] + size * size * sums[_SIZE]
    weight = prior_s + sums[_SECONDS]
    return max((prior_s + centre) / weight, 1.0), max((prior_s + rest) / weight, 1.0)


@njit(cache=True)
def tail_weight(distance: float, dims: int, freedom: float) -> float:
    """Weight of a pair whose differences have this squared distance d² from what is expected.

    That of Student's t, (ν + p) / (ν + d²): two boxes of two vehicles teach little (Lange, Little, Taylor,
    "Robust statistical modeling using the t distribution", JASA 84, 1989).
    """
    return (freedom + dims) / (freedom + distance)


@njit(cache=True)
def middle_of(sums: FloatArray) -> tuple[float, float]:
    """Where vehicles have been that several sensors saw, on average (px); (0, 0) before the first.

    Args:
        sums: (S, S, 2, 35) of the pairs of a sensor and a later one, by axis (`add_pair`).
    """
    weight = x = y = 0.0
    for s in range(len(sums)):
        for o in range(s + 1, len(sums)):
            for axis in range(2):
                one = sums[s, o, axis]
                weight, x, y = weight + one[6], x + one[7], y + one[8]
    return (x / weight, y / weight) if weight > 0.0 else (0.0, 0.0)


@njit(cache=True)
def solve_offsets(sums: FloatArray, factors: FloatArray, std: FloatArray, offsets: FloatArray) -> None:
    """Find what the sensors are off by, in place.

    Args:
        sums: (S, S, 2, 35) of the pairs of a sensor and a later one, by axis (`add_pair`).
        factors: (S, S, 2, 2) on the variances that were assumed of their centres and ln sides.
        std: (S, 5) prior standard deviations of b, c (px, in the middle of where vehicles have been), d,
            e (px per px) and τ (s); 0 for a sensor that is never off.
        offsets: (S, 2, 6) becomes b, c (px, at the origin of the picture), d, e along x and y, and τ.
    """
    S = len(std)
    matrix, right = np.zeros((NUM_TERMS * S, NUM_TERMS * S)), np.zeros(NUM_TERMS * S)
    sizes, size_right = np.zeros((S, S)), np.zeros(S)
    centre_std, size_std = np.empty(NUM_TERMS * S), std[:, 2].copy()
    for s in range(S):
        for k, column in enumerate((0, 1, 3, 3, 4)):
            centre_std[NUM_TERMS * s + k] = std[s, column]
    x, y = middle_of(sums)
    shift = np.array([0.0, 0.0, x, y, 0.0])
    for axis in range(2):
        matrix[:] = 0.0
        right[:] = 0.0
        sizes[:] = 0.0
        size_right[:] = 0.0
        for s in range(S):
            for o in range(s + 1, S):
                one = sums[s, o, axis]
                p, q = 1.0 / factors[s, o, axis, 0], 1.0 / factors[s, o, axis, 1]
                first, second = NUM_TERMS * s, NUM_TERMS * o
                for k in range(NUM_TERMS):
                    for m in range(NUM_TERMS):
                        # Σ (a − m)(a − m)ᵀ from Σ a aᵀ: the second term of a is 1
                        value = one[NUM_TERMS * k + m] - shift[k] * one[NUM_TERMS + m]
                        value -= shift[m] * (one[NUM_TERMS * k + 1] - shift[k] * one[NUM_TERMS + 1])
                        _difference(matrix, first + k, first + m, second + k, second + m, p * value)
                    value = p * (one[_RIGHT + k] - shift[k] * one[_RIGHT + 1])
                    right[first + k] += value
                    right[second + k] -= value
                _difference(sizes, s, s, o, o, q * one[_SIZE])
                size_right[s] += q * one[_SIZE + 1]
                size_right[o] -= q * one[_SIZE + 1]
        posterior(matrix, right, centre_std)
        posterior(sizes, size_right, size_std)
        for s in range(S):
            b, c, e_x, e_y, lag = right[NUM_TERMS * s : NUM_TERMS * (s + 1)]
            offsets[s, axis] = np.array([b, c - e_x * x - e_y * y, size_right[s], e_x, e_y, lag])


def lags_of(sums: FloatArray, factors: FloatArray, offsets: FloatArray) -> tuple[FloatArray, FloatArray]:
    """By how much each sensor's boxes are older than their times say, and the standard deviation of that (s).

    Differences tell only how much older than others': the youngest have 0. Both axes are weighed by what they
    say. A sensor without pairs has a lag of 0, and an infinite standard deviation.

    Args:
        sums: (S, S, 2, 35) of the pairs (`add_pair`).
        factors: (S, S, 2, 2) on the variances that were assumed.
        offsets: (S, 2, 6) what was found (`solve_offsets`).
    """
    squares = sums[..., NUM_TERMS * NUM_TERMS - 1] / factors[..., 0]
    weight = squares.sum(0) + squares.sum(1)  # (S, 2): each pair says as much of the one as of the other
    said = weight.sum(1)
    seen = said > 0.0
    lag, std = np.zeros(len(said)), np.full(len(said), np.inf)
    if seen.any():
        ahead = (weight * offsets[:, :, 5])[seen].sum(1) / said[seen]
        lag[seen], std[seen] = ahead.max() - ahead, 1.0 / np.sqrt(said[seen])
    return lag, std


@njit(cache=True)
def _difference(matrix: FloatArray, s: int, t: int, o: int, u: int, value: float) -> None:
    """Add `value` times (e_s − e_o)(e_t − e_u)ᵀ, in place."""
    matrix[s, t] += value
    matrix[o, u] += value
    matrix[s, u] -= value
    matrix[o, t] -= value
