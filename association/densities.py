"""How probable it is that a detection lies so far from where its track was expected."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray


class Likelihood(NamedTuple):
    """How probable a difference between what was expected and what was found is.

    Attributes:
        freedom: degrees of freedom of Student's t, > 2; 0 for the normal distribution.
        log_size_range: range of ln width and of ln height over which false boxes spread: what is not measured
            of a size is as probable for a vehicle as for one of them.
    """

    freedom: float
    log_size_range: float


@njit(cache=True)
def log_constants(freedom: float) -> FloatArray:
    """Logarithms of the constants of the density in none, one and two dimensions (3,)."""
    out = np.zeros(3)
    for p in range(1, 3):
        if freedom > 2.0:
            out[p] = math.lgamma(0.5 * (freedom + p)) - math.lgamma(0.5 * freedom)
            out[p] -= 0.5 * p * math.log((freedom - 2.0) * math.pi)
        else:
            out[p] = -0.5 * p * math.log(2.0 * math.pi)
    return out


@njit(cache=True)
def log_density_of(d2: float, det: float, dims: int, freedom: float, constants: FloatArray) -> float:
    """Logarithm of the density of a difference of squared distance d² and covariance of determinant `det`.

    Student's t is scaled to that covariance: its tails are heavier, its middle is higher. Detectors' errors
    are like that (Lange, Little, Taylor, "Robust statistical modeling using the t distribution", JASA 84,
    1989).
    """
    if dims == 0:
        return 0.0
    heavy = freedom > 2.0
    tail = -0.5 * (freedom + dims) * math.log1p(d2 / (freedom - 2.0)) if heavy else -0.5 * d2
    return float(constants[dims] + tail - 0.5 * math.log(det))
