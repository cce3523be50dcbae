"""The Rauch-Tung-Striebel smoother in the form of Bryson and Frazier, which needs no inverse.

With the innovation y of variance S and gain K of a measurement with row H, and C = I - K H, an adjoint λ with
its matrix Λ goes

    back over a measurement:  λ ← Cᵀ λ - Hᵀ y / S,   Λ ← Cᵀ Λ C + Hᵀ H / S
    back over a step:         λ ← Fᵀ λ,              Λ ← Fᵀ Λ F

and a smoothed state is x - P λ with covariance P - P Λ P, given the filtered x and P. Where only few of many
states are wanted it is much cheaper: H and F have few entries, so λ and Λ cost O(n²) a key. Neither needs the
other: who wants the covariances alone goes back with Λ alone.

The price: P - P Λ P is a small difference of large numbers where a prior is far vaguer than what the
measurements after it leave, and errors grow as the square of that: variances 1e4 times as large cost 1e-6 of
a covariance on the harshest timing, 1e6 times a hundredth, and at 1e8 times nothing is left. `is_lost` knows
such keys, and `cov_from_next` goes back to them from their neighbour instead. Ordinary tracks have none.

Source: Bierman, Fixed interval smoothing with discrete measurements, Int. J. Control 18(1), 1973.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph.smoothers.transitions import step_cov

#: Where the next filtered, or the smoothed, variance is a smaller share of the filtered one, digits are lost.
LEAST_SHARE = 1e-4


@njit(cache=True)
def mean_over_measurement(
    dims: tuple[int, ...], h: float, e: int, K: FloatArray, scaled: float, lam: FloatArray
) -> None:
    """Take λ (n,) back over a measurement p + h x_e, y / S = `scaled`, in place; e < 3 for white errors."""
    s = scaled
    for i in range(len(dims)):
        s += K[i] * lam[i]
    lam[0] -= s
    if e >= 3:
        lam[e] -= h * s


@njit(cache=True)
def cov_over_measurement(
    dims: tuple[int, ...], h: float, e: int, K: FloatArray, S: float, Lam: FloatArray, u: FloatArray
) -> None:
    """Take Λ (n, n) back over a measurement p + h x_e, in place; e < 3 for white errors."""
    n = len(dims)
    c = 1.0 / S
    for i in range(n):
        t = 0.0
        for j in range(n):
            t += Lam[i, j] * K[j]
        u[i] = t
        c += K[i] * t
    # Cᵀ Λ C + Hᵀ H / S = Λ - Hᵀ uᵀ - u H + c Hᵀ H with u = Λ K.
    for j in range(n):
        Lam[0, j] -= u[j]
        Lam[j, 0] -= u[j]
    Lam[0, 0] += c
    if e >= 3:
        for j in range(n):
            Lam[e, j] -= h * u[j]
            Lam[j, e] -= h * u[j]
        Lam[0, e] += h * c
        Lam[e, 0] += h * c
        Lam[e, e] += h * h * c


@njit(cache=True)
def mean_over_step(dims: tuple[int, ...], dt: float, phi: FloatArray, lam: FloatArray) -> None:
    """Take λ (n,) to Fᵀ λ, in place."""
    lam[2] += dt * lam[1] + 0.5 * dt * dt * lam[0]
    lam[1] += dt * lam[0]
    for i in range(3, len(dims)):
        lam[i] *= phi[i - 3]


@njit(cache=True)
def cov_over_step(dims: tuple[int, ...], dt: float, phi: FloatArray, Lam: FloatArray) -> None:
    """Take Λ (n, n) to Fᵀ Λ F, in place."""
    n = len(dims)
    half = 0.5 * dt * dt
    for j in range(n):
        Lam[2, j] += dt * Lam[1, j] + half * Lam[0, j]
        Lam[1, j] += dt * Lam[0, j]
        for i in range(3, n):
            Lam[i, j] *= phi[i - 3]
    for i in range(n):
        Lam[i, 2] += dt * Lam[i, 1] + half * Lam[i, 0]
        Lam[i, 1] += dt * Lam[i, 0]
        for j in range(3, n):
            Lam[i, j] *= phi[j - 3]
    for i in range(n):
        for j in range(i):
            # Rounding must not make it grow apart from its transpose.
            Lam[j, i] = Lam[i, j]


@njit(cache=True)
def write_mean(dims: tuple[int, ...], m: FloatArray, P: FloatArray, lam: FloatArray, out: FloatArray) -> None:
    """Write m - P λ (n,)."""
    n = len(dims)
    for i in range(n):
        s = m[i]
        for j in range(n):
            s -= P[i, j] * lam[j]
        out[i] = s


@njit(cache=True)
def write_cov(
    dims: tuple[int, ...], P: FloatArray, Lam: FloatArray, part: FloatArray, sum_: FloatArray, out: FloatArray
) -> None:
    """Write P - P Λ P (n, n)."""
    n = len(dims)
    for i in range(n):
        for j in range(n):
            part[i, j] = P[i, 0] * Lam[0, j]
        # The inner loops run along rows, so that the compiler can do several steps at once.
        for k in range(1, n):
            for j in range(n):
                part[i, j] += P[i, k] * Lam[k, j]
    for i in range(n):
        for j in range(n):
            sum_[j] = P[i, j]
        for k in range(n):
            for j in range(n):
                sum_[j] -= part[i, k] * P[k, j]
        for j in range(i + 1):
            out[i, j] = sum_[j]
            out[j, i] = sum_[j]


@njit(cache=True)
def is_lost(dims: tuple[int, ...], P: FloatArray, after: FloatArray, smoothed: FloatArray) -> bool:
    """Whether P - P Λ P (n, n) has too few digits left; `after` is the filtered covariance of the next key.

    The difference alone does not tell: rounding may leave it large.
    """
    lost = False
    for i in range(len(dims)):
        lost |= not min(smoothed[i, i], after[i, i]) >= LEAST_SHARE * P[i, i]
    return lost


@njit(cache=True)
def cov_from_next(
    dims: tuple[int, ...],
    dt: float,
    jerk: float,
    phi: FloatArray,
    var: FloatArray,
    P: FloatArray,
    G: FloatArray,
    after: FloatArray,
) -> FloatArray:
    """Smoothed covariance (n, n) of a key from that of the next, as a sum without differences.

    That is A P Aᵀ + G (Q + P₊) Gᵀ with A = I - G F: what remains if the next state were known, and what is
    not known of that.

    Args:
        dims: any tuple of n elements (`transitions.py`).
        dt: time to the next key (s).
        jerk: root spectral density of the jerk over that step (px/s^2.5).
        phi: (n - 3,) transition factors of the error states over it.
        var: (n - 3,) variances of their noise.
        P: (n, n) filtered covariance of this key.
        G: (n, n) smoother gain to the next.
        after: (n, n) smoothed covariance of the next key.
    """
    n = len(dims)
    half = 0.5 * dt * dt
    unused, noise = np.empty((n, n)), np.empty((n, n))
    step_cov(dims, dt, jerk, phi, var, np.zeros((n, n)), unused, noise)
    A = np.empty((n, n))
    for i in range(n):
        A[i, 0] = -G[i, 0]
        A[i, 1] = -dt * G[i, 0] - G[i, 1]
        A[i, 2] = -half * G[i, 0] - dt * G[i, 1] - G[i, 2]
        for j in range(3, n):
            A[i, j] = -G[i, j] * phi[j - 3]
        A[i, i] += 1.0
    out = np.empty((n, n))
    for i in range(n):
        for j in range(i + 1):
            s = 0.0
            for k in range(n):
                for c in range(n):
                    s += A[i, k] * P[k, c] * A[j, c] + G[i, k] * (noise[k, c] + after[k, c]) * G[j, c]
            out[i, j] = s
            out[j, i] = s
    return out
