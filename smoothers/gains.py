"""Smoother gains, G = P Fᵀ (F P Fᵀ + Q)⁻¹: how a state follows from the one after it.

Source: Rauch, Tung, Striebel, Maximum likelihood estimates of linear dynamic systems, AIAA J. 3(8), 1965.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.smoothers.transitions import error_steps, step_mean


@njit(cache=True)
def write_gain(
    dims: tuple[int, ...],
    predicted: FloatArray,
    moved: FloatArray,
    L: FloatArray,
    d: FloatArray,
    out: FloatArray,
) -> None:
    """Write G = (F P)ᵀ (F P Fᵀ + Q)⁻¹ (n, n), by LDLᵀ; `moved` = F P is overwritten."""
    n = len(dims)
    for j in range(n):
        s = predicted[j, j]
        for k in range(j):
            s -= L[j, k] * L[j, k] * d[k]
        d[j] = s
        inverse = 1.0 / s
        for i in range(j + 1, n):
            s = predicted[i, j]
            for k in range(j):
                s -= L[i, k] * L[j, k] * d[k]
            L[i, j] = s * inverse
    for i in range(n):
        for k in range(i):
            for c in range(n):
                moved[i, c] -= L[i, k] * moved[k, c]
    for i in range(n - 1, -1, -1):
        inverse = 1.0 / d[i]
        for c in range(n):
            moved[i, c] *= inverse
        for k in range(i + 1, n):
            for c in range(n):
                moved[i, c] -= L[k, i] * moved[k, c]
    for i in range(n):
        for c in range(n):
            out[c, i] = moved[i, c]


@njit(cache=True)
def fill_back(
    dims: tuple[int, ...],
    t: FloatArray,
    correlation_time: FloatArray,
    known: IntArray,
    filtered: FloatArray,
    gain: FloatArray,
    mean: FloatArray,
) -> None:
    """Complete smoothed means of which some are known, in place: x_k = m_k + G_k (x_{k+1} - F m_k).

    Args:
        dims: any tuple of n elements.
        t: (N,) times of the keys (s).
        correlation_time: (B,) correlation times of the error states (s).
        known: (A,) keys whose means are known, ascending; the last is the last of all, N - 1.
        filtered: (N, 2, n) filtered means.
        gain: (N, 2, n, n) smoother gains.
        mean: (N, 2, n) the means.
    """
    n = len(dims)
    phi, var = np.empty(n - 3), np.empty(n - 3)
    jump = np.empty(n)
    i = len(known) - 1
    for k in range(len(mean) - 1, -1, -1):
        if i >= 0 and known[i] == k:
            i -= 1
            continue
        dt = t[k + 1] - t[k]
        error_steps(dt, correlation_time, phi, var)
        for a in range(2):
            step_mean(dims, dt, phi, filtered[k, a], jump)
            for j in range(n):
                jump[j] = mean[k + 1, a, j] - jump[j]
            for j in range(n):
                s = filtered[k, a, j]
                for c in range(n):
                    s += gain[k, a, j, c] * jump[c]
                mean[k, a, j] = s
