"""Small smooth functions of the renderer; smooth, for a jump of radiance would be an event."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

_SIDE = 64  # cells of the table of noise, which repeats
_TABLE = np.random.default_rng(0).uniform(-1.0, 1.0, (_SIDE, _SIDE))


@njit(cache=True, error_model="numpy", inline="always")
def clamp01(x: float) -> float:
    """Limit to [0, 1]."""
    return min(max(x, 0.0), 1.0)


@njit(cache=True, error_model="numpy")
def band(x: float, low: float, high: float, width: float) -> float:
    """Share of a filter of `width` about `x` that lies within [low, high]."""
    return max(0.0, min(x + 0.5 * width, high) - max(x - 0.5 * width, low)) / width


@njit(cache=True, error_model="numpy")
def disc(x: float, y: float, radius: float, width: float) -> float:
    """Coverage of a filter of `width` at (x, y) by a disc about the origin."""
    return clamp01((radius - math.sqrt(x * x + y * y)) / width + 0.5)


@njit(cache=True, error_model="numpy")
def hash01(i: int, j: int, salt: int) -> float:
    """Random number in [0, 1) that belongs to a cell of a lattice."""
    n = (i * 73856093) ^ (j * 19349663) ^ (salt * 83492791)
    n = (n ^ (n >> 13)) * 1274126177
    n &= 0x7FFFFFFF
    n = ((n ^ (n >> 16)) * 2246822519) & 0x7FFFFFFF
    return (n ^ (n >> 15)) / 2147483648.0


@njit(cache=True, error_model="numpy")
def value_noise(x: float, y: float, salt: int) -> float:
    """Smooth random field in [-1, 1] with cells of size 1."""
    i, j = math.floor(x), math.floor(y)
    fx, fy = x - i, y - j
    fx, fy = fx * fx * (3.0 - 2.0 * fx), fy * fy * (3.0 - 2.0 * fy)
    low = hash01(i, j, salt) * (1.0 - fx) + hash01(i + 1, j, salt) * fx
    high = hash01(i, j + 1, salt) * (1.0 - fx) + hash01(i + 1, j + 1, salt) * fx
    return 2.0 * (low * (1.0 - fy) + high * fy) - 1.0


@njit(cache=True, error_model="numpy")
def table_noise(x: float, y: float, salt: int) -> float:
    """Smooth random field in [-1, 1] with cells of size 1, repeated every 64: a cheaper `value_noise`."""
    i, j = math.floor(x), math.floor(y)
    fx, fy = x - i, y - j
    fx, fy = fx * fx * (3.0 - 2.0 * fx), fy * fy * (3.0 - 2.0 * fy)
    i, j = (int(i) + 17 * salt) & (_SIDE - 1), (int(j) + 29 * salt) & (_SIDE - 1)
    right, down = (i + 1) & (_SIDE - 1), (j + 1) & (_SIDE - 1)
    low = _TABLE[i, j] * (1.0 - fx) + _TABLE[right, j] * fx
    high = _TABLE[i, down] * (1.0 - fx) + _TABLE[right, down] * fx
    out: float = low * (1.0 - fy) + high * fy
    return out
