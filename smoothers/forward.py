"""The compiled Kalman filter over tracks whose sensors' errors may have a memory (`transitions.py`)."""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.smoothers.transitions import error_steps, step_cov, step_mean


@njit(cache=True)
def filter_rows(
    dims: tuple[int, ...],
    first: int,
    end: int,
    taken: int,
    given: bool,
    t: FloatArray,
    q: FloatArray,
    memory: FloatArray,
    row: IntArray,
    z: FloatArray,
    info: FloatArray,
    lever: FloatArray,
    error: IntArray,
    mean: FloatArray,
    cov: FloatArray,
    gain: FloatArray,
    innovation: FloatArray,
    variance: FloatArray,
) -> None:
    """Kalman filter over some keys of one track (paper eq. 2 to 4), in place.

    The update is in Joseph form, so that no rounding makes a covariance indefinite; coincident
    measurements are taken in one after the other.

    Args:
        dims: any tuple of n elements.
        first: the first key to filter.
        end: the key after the last.
        taken: the first measurement of these keys.
        given: whether the first key's state is there already, but for its measurements; otherwise it is
            predicted from the key before.
        t: (N,) times of all keys (s).
        q: (N,) root spectral density of the jerk over the step that ends at each (px/s^2.5).
        memory: (B,) memory of the error states (s).
        row: (M,) key of each measurement, ascending.
        z: (M, 2) measurements (px).
        info: (M, 2) their information (1/px²), > 0: of the white part alone.
        lever: (M, 2) factor of the error state in each (px).
        error: (M,) its index, or -1.
        mean: (N, 2, n) filtered means.
        cov: (N, 2, n, n) filtered covariances.
        gain: (M, 2, n) gain of each measurement.
        innovation: (M, 2) its innovation (px).
        variance: (M, 2) the variance of that (px²).
    """
    n = len(dims)
    phi, var = np.empty(n - 3), np.empty(n - 3)
    moved = np.empty((n, n))
    seen = np.empty(n)
    i = taken
    for k in range(first, end):
        if k > first or not given:
            dt = t[k] - t[k - 1]
            error_steps(dt, memory, phi, var)
            for a in range(2):
                step_mean(dims, dt, phi, mean[k - 1, a], mean[k, a])
                step_cov(dims, dt, q[k], phi, var, cov[k - 1, a], moved, cov[k, a])
        while i < len(row) and row[i] == k:
            e = error[i] + 3
            for a in range(2):
                m, P = mean[k, a], cov[k, a]
                h = lever[i, a] if e >= 3 else 0.0
                y = z[i, a] - m[0]
                for j in range(n):
                    seen[j] = P[0, j]
                if e >= 3:
                    y -= h * m[e]
                    for j in range(n):
                        seen[j] += h * P[e, j]
                    S = seen[0] + h * seen[e] + 1.0 / info[i, a]
                else:
                    S = seen[0] + 1.0 / info[i, a]
                K = gain[i, a]
                for j in range(n):
                    K[j] = seen[j] / S
                    m[j] += K[j] * y
                for j in range(n):
                    for c in range(j + 1):
                        # (I - K H) P (I - K H)ᵀ + K r Kᵀ written out.
                        new = P[j, c] + (K[j] * S * K[c] - K[j] * seen[c] - seen[j] * K[c])
                        P[j, c] = new
                        P[c, j] = new
                innovation[i, a] = y
                variance[i, a] = S
            i += 1
