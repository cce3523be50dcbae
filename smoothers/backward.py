"""The compiled smoother: back over what the filter has made of a track (`forward.py`).

It is the Rauch-Tung-Striebel smoother in the form of Bryson and Frazier, which needs no inverse: with the
innovation y of variance S and gain K of a measurement with row H, and C = I - K H, an adjoint λ with its
matrix Λ goes

    back over a measurement:  λ ← Cᵀ λ - Hᵀ y / S,   Λ ← Cᵀ Λ C + Hᵀ H / S
    back over a step:         λ ← Fᵀ λ,              Λ ← Fᵀ Λ F

and a smoothed state is x - P λ with covariance P - P Λ P, given the filtered x and P. Where only few of many
states are wanted it is much cheaper: H and F have few entries, so λ and Λ cost O(n²) a key.

Source: Bierman, Fixed interval smoothing with discrete measurements, Int. J. Control 18(1), 1973.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.arrays import FloatArray, IntArray
from jeat_graph.smoothers.transitions import error_steps, step_cov, step_mean


@njit(cache=True)
def _back_over_measurement(
    dims: tuple[int, ...],
    h: float,
    e: int,
    K: FloatArray,
    y: float,
    S: float,
    lam: FloatArray,
    Lam: FloatArray,
    u: FloatArray,
) -> None:
    """Take λ (n,) and Λ (n, n) back over a measurement p + h x_e, in place; e < 3 for white errors."""
    n = len(dims)
    s = y / S
    c = 1.0 / S
    for i in range(n):
        s += K[i] * lam[i]
        t = 0.0
        for j in range(n):
            t += Lam[i, j] * K[j]
        u[i] = t
        c += K[i] * t
    lam[0] -= s
    # Cᵀ Λ C + Hᵀ H / S = Λ - Hᵀ uᵀ - u H + c Hᵀ H with u = Λ K.
    for j in range(n):
        Lam[0, j] -= u[j]
        Lam[j, 0] -= u[j]
    Lam[0, 0] += c
    if e >= 3:
        lam[e] -= h * s
        for j in range(n):
            Lam[e, j] -= h * u[j]
            Lam[j, e] -= h * u[j]
        Lam[0, e] += h * c
        Lam[e, 0] += h * c
        Lam[e, e] += h * h * c


@njit(cache=True)
def _back_over_step(
    dims: tuple[int, ...], dt: float, phi: FloatArray, lam: FloatArray, Lam: FloatArray
) -> None:
    """Take λ (n,) to Fᵀ λ and Λ (n, n) to Fᵀ Λ F, in place."""
    n = len(dims)
    half = 0.5 * dt * dt
    lam[2] += dt * lam[1] + half * lam[0]
    lam[1] += dt * lam[0]
    for i in range(3, n):
        lam[i] *= phi[i - 3]
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
def _smoothed(
    dims: tuple[int, ...],
    m: FloatArray,
    P: FloatArray,
    lam: FloatArray,
    Lam: FloatArray,
    part: FloatArray,
    sum_: FloatArray,
    out_mean: FloatArray,
    out_cov: FloatArray,
) -> None:
    """Write m - P λ and P - P Λ P."""
    n = len(dims)
    for i in range(n):
        s = m[i]
        for j in range(n):
            s -= P[i, j] * lam[j]
            part[i, j] = P[i, 0] * Lam[0, j]
        out_mean[i] = s
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
            out_cov[i, j] = sum_[j]
            out_cov[j, i] = sum_[j]


@njit(cache=True)
def _gain(
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
def smooth_rows(
    dims: tuple[int, ...],
    first: int,
    end: int,
    taken: int,
    wanted: int,
    t: FloatArray,
    q: FloatArray,
    memory: FloatArray,
    row: IntArray,
    lever: FloatArray,
    error: IntArray,
    mean: FloatArray,
    cov: FloatArray,
    gain: FloatArray,
    innovation: FloatArray,
    variance: FloatArray,
    out_mean: FloatArray,
    out_cov: FloatArray,
    out_gain: FloatArray,
) -> None:
    """Smooth some keys of one track, given what `filter_rows` has made of them.

    Args:
        dims: any tuple of n elements.
        first: the first key.
        end: the key after the last.
        taken: the measurement after the last of these keys.
        wanted: how many states are wanted, from the first on.
        t: (N,) as for `filter_rows`.
        q: (N,) as for `filter_rows`.
        memory: (B,) as for `filter_rows`.
        row: (M,) as for `filter_rows`.
        lever: (M, 2) as for `filter_rows`.
        error: (M,) as for `filter_rows`.
        mean: (N, 2, n) filtered means.
        cov: (N, 2, n, n) filtered covariances.
        gain: (M, 2, n) gains.
        innovation: (M, 2) innovations (px).
        variance: (M, 2) their variances (px²).
        out_mean: (wanted, 2, n) becomes the smoothed means.
        out_cov: (wanted, 2, n, n) becomes their covariances.
        out_gain: (wanted, 2, n, n) becomes the smoother gains from each key to the next, zero at the last.
    """
    n = len(dims)
    phi, var = np.empty(n - 3), np.empty(n - 3)
    lam, Lam = np.zeros((2, n)), np.zeros((2, n, n))
    u, d = np.empty(n), np.empty(n)
    predicted, part, L = np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    i, dt = taken - 1, 0.0
    for k in range(end - 1, first - 1, -1):
        if k < end - 1:
            # dt, phi and var are those of the step from k to k + 1.
            for a in range(2):
                _back_over_step(dims, dt, phi, lam[a], Lam[a])
        if k - first < wanted:
            o = k - first
            for a in range(2):
                if k < end - 1:
                    P = cov[k, a]
                    _smoothed(dims, mean[k, a], P, lam[a], Lam[a], part, u, out_mean[o, a], out_cov[o, a])
                    step_cov(dims, dt, q[k + 1], phi, var, P, part, predicted)
                    _gain(dims, predicted, part, L, d, out_gain[o, a])
                else:
                    out_mean[o, a] = mean[k, a]
                    out_cov[o, a] = cov[k, a]
                    out_gain[o, a] = 0.0
        while i >= 0 and row[i] == k:
            for a in range(2):
                h, y, S = lever[i, a], innovation[i, a], variance[i, a]
                _back_over_measurement(dims, h, error[i] + 3, gain[i, a], y, S, lam[a], Lam[a], u)
            i -= 1
        if k > first:
            dt = t[k] - t[k - 1]
            error_steps(dt, memory, phi, var)


@njit(cache=True)
def backward(
    dims: tuple[int, ...],
    t: FloatArray,
    q: FloatArray,
    memory: FloatArray,
    row: IntArray,
    lever: FloatArray,
    error: IntArray,
    start: IntArray,
    mean: FloatArray,
    cov: FloatArray,
    gain: FloatArray,
    innovation: FloatArray,
    variance: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Smooth many tracks, given what `forward` returned.

    Args:
        dims: any tuple of n elements.
        t: (N,) as for `forward`.
        q: (N,) as for `forward`.
        memory: (B,) as for `forward`.
        row: (M,) as for `forward`.
        lever: (M, 2) as for `forward`.
        error: (M,) as for `forward`.
        start: (T + 1,) as for `forward`.
        mean: (N, 2, n) filtered means.
        cov: (N, 2, n, n) filtered covariances.
        gain: (M, 2, n) gains.
        innovation: (M, 2) innovations (px).
        variance: (M, 2) their variances (px²).

    Returns:
        (N, 2, n) smoothed means, (N, 2, n, n) covariances, and (N, 2, n, n) smoother gains; the gain in row
        k is of the step from k to k + 1, and zero at the last key of a track.
    """
    out_mean, out_cov, out_gain = np.empty_like(mean), np.empty_like(cov), np.empty_like(cov)
    model = (t, q, memory, row, lever, error)
    filtered = (mean, cov, gain, innovation, variance)
    for track in range(len(start) - 1):
        k, end = start[track], start[track + 1]
        out = (out_mean[k:end], out_cov[k:end], out_gain[k:end])
        smooth_rows(dims, k, end, np.searchsorted(row, end), end - k, *model, *filtered, *out)
    return out_mean, out_cov, out_gain


@njit(cache=True)
def backward_between(
    dims: tuple[int, ...],
    t: FloatArray,
    memory: FloatArray,
    row: IntArray,
    lever: FloatArray,
    error: IntArray,
    mean: FloatArray,
    cov: FloatArray,
    gain: FloatArray,
    innovation: FloatArray,
    variance: FloatArray,
    at: IntArray,
    until: IntArray,
) -> tuple[FloatArray, FloatArray]:
    """Smooth some keys of one track, each with the measurements up to a key of its own.

    Args:
        dims: any tuple of n elements.
        t: (N,) as for `forward`.
        memory: (B,) as for `forward`.
        row: (M,) as for `forward`.
        lever: (M, 2) as for `forward`.
        error: (M,) as for `forward`.
        mean: (N, 2, n) filtered means.
        cov: (N, 2, n, n) filtered covariances.
        gain: (M, 2, n) gains.
        innovation: (M, 2) innovations (px).
        variance: (M, 2) their variances (px²).
        at: (T,) keys wanted.
        until: (T,) the last key whose measurements count, >= `at`.

    Returns:
        (T, 2, n) means and (T, 2, n, n) covariances.
    """
    n = len(dims)
    out_mean, out_cov = np.empty((len(at), 2, n)), np.empty((len(at), 2, n, n))
    phi, var = np.empty(n - 3), np.empty(n - 3)
    lam, Lam = np.empty((2, n)), np.empty((2, n, n))
    u, part = np.empty(n), np.empty((n, n))
    for o in range(len(at)):
        lam[:] = 0.0
        Lam[:] = 0.0
        i = np.searchsorted(row, until[o], side="right") - 1
        for k in range(until[o], at[o], -1):
            while i >= 0 and row[i] == k:
                for a in range(2):
                    h, y, S = lever[i, a], innovation[i, a], variance[i, a]
                    _back_over_measurement(dims, h, error[i] + 3, gain[i, a], y, S, lam[a], Lam[a], u)
                i -= 1
            dt = t[k] - t[k - 1]
            error_steps(dt, memory, phi, var)
            for a in range(2):
                _back_over_step(dims, dt, phi, lam[a], Lam[a])
        k = at[o]
        for a in range(2):
            _smoothed(dims, mean[k, a], cov[k, a], lam[a], Lam[a], part, u, out_mean[o, a], out_cov[o, a])
    return out_mean, out_cov


@njit(cache=True)
def fill_back(
    dims: tuple[int, ...],
    t: FloatArray,
    memory: FloatArray,
    known: IntArray,
    filtered: FloatArray,
    gain: FloatArray,
    mean: FloatArray,
) -> None:
    """Complete smoothed means of which some are known, in place: x_k = m_k + G_k (x_{k+1} - F m_k).

    Args:
        dims: any tuple of n elements.
        t: (N,) times of the keys (s).
        memory: (B,) memory of the error states (s).
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
        error_steps(dt, memory, phi, var)
        for a in range(2):
            step_mean(dims, dt, phi, filtered[k, a], jump)
            for j in range(n):
                jump[j] = mean[k + 1, a, j] - jump[j]
            for j in range(n):
                s = filtered[k, a, j]
                for c in range(n):
                    s += gain[k, a, j, c] * jump[c]
                mean[k, a, j] = s
