"""Random numbers of a pixel's own, so that they do not depend on the order in which pixels are worked on."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

_STEP, _MIX1, _MIX2 = (np.uint64(v) for v in (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB))
_S30, _S27, _S31, _S11 = (np.uint64(v) for v in (30, 27, 31, 11))


@njit(cache=True, error_model="numpy")
def uniform(state: npt.NDArray[np.uint64], i: int) -> float:
    """Next number in [0, 1) of stream `i` (SplitMix64: Steele, Lea, Flood 2014)."""
    state[i] += _STEP
    z = state[i]
    z = (z ^ (z >> _S30)) * _MIX1
    z = (z ^ (z >> _S27)) * _MIX2
    z = z ^ (z >> _S31)
    return float(z >> _S11) * (1.0 / 9007199254740992.0)


@njit(cache=True, error_model="numpy")
def exponential(state: npt.NDArray[np.uint64], i: int, rate: float) -> float:
    """Waiting time of a Poisson process with `rate`; infinite for rate 0."""
    if rate <= 0.0:
        return math.inf
    return -math.log(1.0 - uniform(state, i)) / rate


@njit(cache=True, error_model="numpy")
def normal(state: npt.NDArray[np.uint64], i: int) -> float:
    """Standard normal number (Box, Muller 1958)."""
    radius = math.sqrt(-2.0 * math.log(1.0 - uniform(state, i)))
    return radius * math.cos(2.0 * math.pi * uniform(state, i))


def seeds(rng: np.random.Generator, count: int) -> npt.NDArray[np.uint64]:
    """Draw the states (count,) of as many streams."""
    return rng.integers(0, 2**64, size=count, dtype=np.uint64)
