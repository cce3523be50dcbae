"""How fast a track's box changes its size, learnt while it runs: its size filtered under three densities.

Seen from a pole, a vehicle's box grows and shrinks slowly, and its size tells it from others. Seen from a
moving car, or where a vehicle turns and a walker swings his legs, it changes in a moment. A size filter too
stiff lags behind the one, one too loose learns nothing of the other but the last box. So each track carries
three size filters beside its own that differ in the density of the rate's noise alone, and Bayes' rule weighs
them by how well each foretold the sizes, as with the densities of the jerk (`manoeuvre.py`).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.filters.jerk import MOST_GROWTH, common_growth
from jeat_graph.filters.kalman import log_gaussian, update_block
from jeat_graph.filters.manoeuvre import weigh


@njit(cache=True)
def resizing_density(size_mean: FloatArray, density: float, per_growth: float) -> float:
    """Root spectral density of the rate of a track's ln size (1/s^1.5), perspective included.

    Of a vehicle that passes at constant speed the growth g = d ln(size) / dt is 1 / (t₀ − t), so it grows by
    itself at g², for about 1 / g; as the density of a white process that is g^1.5, however calm its size is
    otherwise (`jerk.jerk_density` says the same of the jerk).

    Args:
        size_mean: (2, 2) ln width and ln height with their rates.
        density: what it is without perspective.
        per_growth: part of perspective, in units of |growth|^1.5.
    """
    g = min(abs(common_growth(size_mean[0, 1], size_mean[1, 1])), MOST_GROWTH)
    perspective = per_growth * g * math.sqrt(g)
    return density if perspective == 0.0 else math.sqrt(density * density + perspective * perspective)


@njit(cache=True)
def weigh_resizing(
    mean: FloatArray,
    cov: FloatArray,
    weight: FloatArray,
    z: FloatArray,
    R: FloatArray,
    whole: BoolArray,
    exactness: float,
) -> float:
    """Update the size filters of one track with a box and weigh them by how well they foretold it, in place.

    Args:
        mean: (K, 2, 2) per density and side [ln size, rate].
        cov: (K, 2, 2, 2) covariance.
        weight: (K,) probability of each density.
        z: (2,) measured ln width and ln height (ln px).
        R: (2,) their variances.
        whole: (2,) which sides are seen whole; of the others nothing is said.
        exactness: how many times smaller than expected the squares of innovations usually are.

    Returns:
        The mean over the whole sides of the normalised innovation squared of the middle density; of none, 0.
    """
    K = len(weight)
    fit, square, sides = np.zeros(K), 0.0, 0
    for side in range(2):
        if not whole[side]:
            continue
        sides += 1
        for k in range(K):
            y, S = z[side] - mean[k, side, 0], cov[k, side, 0, 0] + R[side]
            fit[k] += log_gaussian(y, S / exactness)
            if k == K // 2:
                square += y * y / S
            update_block(mean[k, side], cov[k, side], z[side], R[side])
    if sides == 0:
        return 0.0
    weigh(weight, fit)
    return square / sides
