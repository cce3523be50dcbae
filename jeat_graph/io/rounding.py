"""Rounding of tables, so that a file holds the digits that mean something."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray

_MOST_DECIMALS = 22  # 10^22 is the largest power of ten that a float holds exactly
_MOST_POWER = 308  # the largest of which there is a float
_POWERS = 10.0 ** np.arange(0.0, _MOST_POWER + 1.0)
_LOG10_2 = math.log10(2.0)


def round_decimals(values: FloatArray, decimals: int) -> FloatArray:
    """Round to a number of decimals; minus zero becomes zero."""
    return np.asarray(np.round(values, decimals) + 0.0, dtype=np.float64)


def round_significant(values: FloatArray, digits: int) -> FloatArray:
    """Round to a number of significant decimal digits; zero, NaN and infinity stay.

    No more than 22 decimals are kept, so what is much smaller becomes zero.
    """
    out = np.array(values, dtype=np.float64, order="C")
    _round_significant(out.reshape(-1), digits)
    return out


@njit(cache=True)
def _round_significant(values: FloatArray, digits: int) -> None:
    """Round (N,) in place; compiled, for live tables have few rows and come a hundred times a second."""
    for k in range(len(values)):
        value = values[k]
        size = abs(value)
        if size == 0.0 or not math.isfinite(size):
            values[k] = value + 0.0  # minus zero becomes zero
            continue
        place = min(digits - 1 - _power_below(size), _MOST_DECIMALS)
        # Both factors are exact powers of ten, one is 1: the result is the float nearest to its digits.
        up, down = _POWERS[max(place, 0)], _POWERS[max(-place, 0)]
        rounded = np.rint(value * up / down) / up * down
        if math.isfinite(rounded):
            values[k] = rounded + 0.0


@njit(cache=True)
def _power_below(size: float) -> int:
    """Greatest n with 10^n <= size, for a positive number; of very small ones one that is small enough."""
    # From the power of two below, which gives one that is at most one too small.
    power = math.floor((math.frexp(size)[1] - 1) * _LOG10_2)
    if power < -_MOST_POWER:
        return power
    above = power + 1
    if above > _MOST_POWER:
        return power
    ten = _POWERS[above] if above >= 0 else 1.0 / _POWERS[-above]
    return above if size >= ten else power
