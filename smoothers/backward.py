"""The compiled smoother: back over what the filter has made of a track (`forward.py`), see `adjoint.py`."""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.smoothers.adjoint import back_over_measurement, back_over_step, smooth_one
from jeat_graph.smoothers.gains import write_gain
from jeat_graph.smoothers.transitions import error_steps, step_cov


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
                back_over_step(dims, dt, phi, lam[a], Lam[a])
        if k - first < wanted:
            o = k - first
            for a in range(2):
                if k < end - 1:
                    P = cov[k, a]
                    smooth_one(dims, mean[k, a], P, lam[a], Lam[a], part, u, out_mean[o, a], out_cov[o, a])
                    step_cov(dims, dt, q[k + 1], phi, var, P, part, predicted)
                    write_gain(dims, predicted, part, L, d, out_gain[o, a])
                else:
                    out_mean[o, a] = mean[k, a]
                    out_cov[o, a] = cov[k, a]
                    out_gain[o, a] = 0.0
        while i >= 0 and row[i] == k:
            for a in range(2):
                h, y, S = lever[i, a], innovation[i, a], variance[i, a]
                back_over_measurement(dims, h, error[i] + 3, gain[i, a], y, S, lam[a], Lam[a], u)
            i -= 1
        if k > first:
            dt = t[k] - t[k - 1]
            error_steps(dt, memory, phi, var)


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
        t: (N,) as for `filter_rows`.
        memory: (B,) as for `filter_rows`.
        row: (M,) as for `filter_rows`.
        lever: (M, 2) as for `filter_rows`.
        error: (M,) as for `filter_rows`.
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
                    back_over_measurement(dims, h, error[i] + 3, gain[i, a], y, S, lam[a], Lam[a], u)
                i -= 1
            dt = t[k] - t[k - 1]
            error_steps(dt, memory, phi, var)
            for a in range(2):
                back_over_step(dims, dt, phi, lam[a], Lam[a])
        k = at[o]
        for a in range(2):
            smooth_one(dims, mean[k, a], cov[k, a], lam[a], Lam[a], part, u, out_mean[o, a], out_cov[o, a])
    return out_mean, out_cov
