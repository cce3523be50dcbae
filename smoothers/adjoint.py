"""The Rauch-Tung-Striebel smoother in the form of Bryson and Frazier, which needs no inverse.

With the innovation y of variance S and gain K of a measurement with row H, and C = I - K H, an adjoint λ with
its matrix Λ goes

    back over a measurement:  λ ← Cᵀ λ - Hᵀ y / S,   Λ ← Cᵀ Λ C + Hᵀ H / S
    back over a step:         λ ← Fᵀ λ,              Λ ← Fᵀ Λ F

and a smoothed state is x - P λ with covariance P - P Λ P, given the filtered x and P. Where only few of many
states are wanted it is much cheaper: H and F have few entries, so λ and Λ cost O(n²) a key. Neither needs the
other: who wants the covariances alone goes back with Λ alone.

The price: a prior κ times as vague as what the first measurements leave of it costs κ² roundings in the
covariances. At 1000 px/s against a few px/s that is 1e-9, at 100,000 px/s nothing is left.

Source: Bierman, Fixed interval smoothing with discrete measurements, Int. J. Control 18(1), 1973.
"""

from __future__ import annotations

from numba import njit

from jeat_graph.data.arrays import FloatArray


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
