"""Functions of the C library, for code that must give what compiled kernels give.

Python has its own `lgamma`, whose last bits are others.
"""

from __future__ import annotations

import math

from numba import njit


@njit(cache=True)
def lgamma(x: float) -> float:
    """Return the logarithm of the absolute value of the gamma function, as the C library has it."""
    return math.lgamma(x)
