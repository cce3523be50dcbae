"""Linear regression with independent normal priors of mean 0, from sums over the data."""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray


@njit(cache=True)
def posterior(precision: FloatArray, right: FloatArray, std: FloatArray) -> None:
    """Turn the precision of the data and their right side into posterior covariance and mean, in place.

    With D = diag(std), (Λ + D⁻²)⁻¹ = D (I + D Λ D)⁻¹ D: nothing is divided by a prior of 0, and what is
    inverted has no eigenvalue below 1.

    Args:
        precision: (K, K) Λ, becomes the covariance.
        right: (K,) becomes the mean.
        std: (K,) prior standard deviations, about 0.
    """
    n = len(std)
    for i in range(n):
        for j in range(n):
            precision[i, j] *= std[i] * std[j]
        precision[i, i] += 1.0
    # Gauss-Jordan without a search for pivots, which a matrix like that does not need.
    for k in range(n):
        pivot = 1.0 / precision[k, k]
        precision[k, k] = 1.0
        for j in range(n):
            precision[k, j] *= pivot
        for i in range(n):
            if i == k:
                continue
            factor = precision[i, k]
            precision[i, k] = 0.0
            for j in range(n):
                precision[i, j] -= factor * precision[k, j]
    mean = np.zeros(n)
    for i in range(n):
        for j in range(n):
            precision[i, j] *= std[i] * std[j]
            mean[i] += precision[i, j] * right[j]
    right[:] = mean
