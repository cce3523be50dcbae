"""How large a track's box is, from the logarithms of its sides that the size filter follows."""

from __future__ import annotations

import math

from numba import njit

from jeat_graph.data.arrays import FloatArray

#: A size beyond e^12 px, from a runaway extrapolation, must not overflow.
MOST_LOG_SIZE = 12.0


@njit(cache=True)
def mean_side(size_mean: FloatArray) -> float:
    """Size of a box, sqrt(w h) (px).

    Args:
        size_mean: (2, 2) ln width and ln height with their rates.
    """
    return math.exp(min(0.5 * (size_mean[0, 0] + size_mean[1, 0]), MOST_LOG_SIZE))
