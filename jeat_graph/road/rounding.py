"""Compiled rounding of the road's tables, as `io.table_writer` rounds: few rows at a time take less."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray

_MOST_DECIMALS = 22  # 10^22 is the largest power of ten that a float holds exactly
_POWERS = 10.0 ** np.arange(0.0, 309.0)
_LOG10_2 = math.log10(2.0)


@njit(cache=True)
def round_states(mean: FloatArray, var: FloatArray, decimals: int, digits: int) -> None:
    """Round in place.

    Args:
        mean: any shape, to `decimals` decimals; minus zero becomes zero.
        var: any shape, to `digits` significant digits; zero and what is not finite stay.
        decimals: not negative.
        digits: at least one.
    """
    scale = _POWERS[decimals]
    flat = mean.reshape(-1)
    for k in range(len(flat)):
        flat[k] = np.rint(flat[k] * scale) / scale + 0.0
    flat = var.reshape(-1)
    for k in range(len(flat)):
        value = flat[k]
        size = abs(value)
        if not (1e-250 < size < 1e250):
            continue
        # The power of ten below: from that of two, which is at most one too small.
        power = math.floor((math.frexp(size)[1] - 1) * _LOG10_2)
        if size >= _ten(power + 1):
            power += 1
        place = min(digits - 1 - power, _MOST_DECIMALS)
        up, down = _POWERS[max(place, 0)], _POWERS[max(-place, 0)]
        flat[k] = np.rint(value * up / down) / up * down + 0.0


@njit(cache=True)
def _ten(power: int) -> float:
    if power >= 0:
        return float(_POWERS[power])
    return 1.0 / float(_POWERS[-power])
