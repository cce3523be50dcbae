"""Products of matrices too small for a library call, which also adds in an order of its own."""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray


@njit(cache=True)
def product(A: FloatArray, B: FloatArray) -> FloatArray:
    """A B (m, n) for matrices (m, k), (k, n)."""
    out = np.zeros((A.shape[0], B.shape[1]))
    for i in range(A.shape[0]):
        for k in range(B.shape[0]):
            for j in range(B.shape[1]):
                out[i, j] += A[i, k] * B[k, j]
    return out
