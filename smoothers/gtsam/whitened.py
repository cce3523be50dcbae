"""Motion and measurements as whitened rows on scaled states (`scaling.py`), for GTSAM's linear factors.

These take diagonal noise only, so each row is divided by its standard deviation here ("whitened") and the
factor carries unit noise.

GTSAM need not know every state. What several steps and their measurements say about the states at the
two ends is a linear factor as well: the states in between are eliminated here, at a fraction of the cost
of a variable there. Nothing is lost: they follow from the state after them by the filter's gains.

The heaviest of the rows that meet in an elimination have to be the first, or QR loses digits (Cox, Higham,
Stability of Householder QR factorization for weighted least squares problems, 1998): motion comes before
measurements within a factor, and the steps before a prior in a graph.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.smoothers.gtsam.scaling import TAU_S, scale
from jeat_graph.smoothers.passes import Observations, Steps
from jeat_graph.smoothers.transitions import error_steps, step_cov


@njit(cache=True)
def segment_rows(
    dims: tuple[int, ...],
    ends: IntArray,
    steps: Steps,
    observations: Observations,
    reference: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """Rows of the steps between some states, and of the measurements after each up to the next.

    Let the state at the beginning of a segment be known. Then a Kalman filter gives each measurement's
    innovation, d - B x0 of variance S, and in the end x1 - A x0 - c of covariance P; all of these are
    independent of each other. Divided by their standard deviations they are the rows. The measurements at
    the end itself need no filter: they are rows on x1.

    Args:
        dims: any tuple of n elements (`transitions.py`).
        ends: (S + 1,) the states that GTSAM knows, ascending; those in between are eliminated.
        steps: times of all states and how they follow each other.
        observations: the measurements; `key` is the state of each.
        reference: (N, 2, n) references of all states.

    Returns:
        A0 (S, R, 2 n), A1 (S, R, 2 n), b (S, R) and counts (S,): the first `counts` rows of each are used,
        and A0 y0 + A1 y1 - b is white for the scaled states y at the ends of a segment.
    """
    n = len(dims)
    row, error = observations.key, observations.error
    segments = len(ends) - 1
    first = np.searchsorted(row, ends + 1)
    most = 0
    for s in range(segments):
        most = max(most, first[s + 1] - first[s])
    A0 = np.zeros((segments, 2 * (n + most), 2 * n))
    A1 = np.zeros((segments, 2 * (n + most), 2 * n))
    b = np.zeros((segments, 2 * (n + most)))
    counts = 2 * (n + first[1:] - first[:-1])
    scales = np.ones(n)
    scales[1], scales[2] = 1.0 / TAU_S, 1.0 / (TAU_S * TAU_S)
    phi, var = np.empty(n - 3), np.empty(n - 3)
    P, old, moved, L = np.empty((n, n)), np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    A, c, seen, B = np.empty((n, n)), np.empty(n), np.empty(n), np.empty(n)
    for s in range(segments):
        for a in range(2):
            i, last, place = first[s], ends[s + 1], 2 * n + a
            A[:] = 0.0
            for j in range(n):
                A[j, j] = 1.0
            old[:] = 0.0
            c[:] = 0.0
            for k in range(ends[s] + 1, last + 1):
                dt = steps.t[k] - steps.t[k - 1]
                error_steps(dt, steps.correlation_time, phi, var)
                step_cov(dims, dt, steps.jerk[k], phi, var, old, moved, P)
                _step_rows(dims, dt, phi, reference[k - 1, a], reference[k, a], A, c)
                while i < len(row) and row[i] == k:
                    e = error[i] + 3
                    h = observations.coloured_std[i, a] if e >= 3 else 0.0
                    e = max(e, 3) if n > 3 else 0
                    d = observations.z[i, a] - reference[k, a, 0] - h * reference[k, a, e]
                    if k == last:
                        root = np.sqrt(observations.information[i, a])
                        A1[s, place, a * n] = root
                        A1[s, place, a * n + e] += root * h
                        b[s, place] = root * d
                    else:
                        d -= c[0] + h * c[e]
                        for j in range(n):
                            seen[j] = P[0, j] + h * P[e, j]
                            B[j] = A[0, j] + h * A[e, j]
                        S = seen[0] + h * seen[e] + 1.0 / observations.information[i, a]
                        root = 1.0 / np.sqrt(S)
                        for j in range(n):
                            A0[s, place, a * n + j] = root * scales[j] * B[j]
                        b[s, place] = root * d
                        for j in range(n):
                            K = seen[j] / S
                            c[j] += K * d
                            for x in range(n):
                                A[j, x] -= K * B[x]
                                P[j, x] -= K * seen[x]
                    place += 2
                    i += 1
                for j in range(n):
                    for x in range(n):
                        old[j, x] = P[j, x]
            _whiten(dims, P, A, c, L)
            for j in range(n):
                # Both axes' motion comes before all measurements.
                place = 2 * j + a
                b[s, place] = c[j]
                for x in range(n):
                    A0[s, place, a * n + x] = -scales[x] * A[j, x]
                    A1[s, place, a * n + x] = scales[x] * L[j, x]
    return A0, A1, b, counts


@njit(cache=True)
def _step_rows(
    dims: tuple[int, ...],
    dt: float,
    phi: FloatArray,
    before: FloatArray,
    after: FloatArray,
    A: FloatArray,
    c: FloatArray,
) -> None:
    """Take A (n, n) to F A, and c (n,), relative to the reference `before`, to F c relative to `after`."""
    n = len(dims)
    half = 0.5 * dt * dt
    for j in range(n):
        A[0, j] += dt * A[1, j] + half * A[2, j]
        A[1, j] += dt * A[2, j]
        for i in range(3, n):
            A[i, j] *= phi[i - 3]
    c[0] += dt * c[1] + half * c[2] - (after[0] - before[0] - dt * (before[1] + 0.5 * dt * before[2]))
    c[1] += dt * c[2] - (after[1] - before[1] - dt * before[2])
    c[2] -= after[2] - before[2]
    for i in range(3, n):
        c[i] = phi[i - 3] * (c[i] + before[i]) - after[i]


@njit(cache=True)
def _whiten(dims: tuple[int, ...], P: FloatArray, A: FloatArray, c: FloatArray, W: FloatArray) -> None:
    """Write W with Wᵀ W = P⁻¹, lower triangular, and take A (n, n) to W A and c (n,) to W c; P is lost."""
    n = len(dims)
    for j in range(n):
        for k in range(j):
            P[j, j] -= P[j, k] * P[j, k]
        P[j, j] = np.sqrt(P[j, j])
        for i in range(j + 1, n):
            for k in range(j):
                P[i, j] -= P[i, k] * P[j, k]
            P[i, j] /= P[j, j]
    for i in range(n):
        inverse = 1.0 / P[i, i]
        for j in range(n):
            W[i, j] = 1.0 if i == j else 0.0
        for k in range(i):
            c[i] -= P[i, k] * c[k]
            for j in range(n):
                A[i, j] -= P[i, k] * A[k, j]
                W[i, j] -= P[i, k] * W[k, j]
        c[i] *= inverse
        for j in range(n):
            A[i, j] *= inverse
            W[i, j] *= inverse


def prior_rows(
    mean: FloatArray, cov: FloatArray, reference: FloatArray, observations: Observations
) -> tuple[FloatArray, FloatArray]:
    """Rows of a prior (2, n), (2, n, n), and of J observations, all of them of one state.

    Returns:
        A (R, 2 n) and b (R,) with A y - b white, R = 2 (n + J).
    """
    n, count = mean.shape[1], len(observations.z)
    D = scale(n)
    A, b = np.zeros((2 * (n + count), 2 * n)), np.zeros(2 * (n + count))
    for axis in range(2):
        block, rows = slice(axis * n, (axis + 1) * n), 2 * n + axis * count + np.arange(count)
        A[block, block] = np.linalg.inv(np.linalg.cholesky(cov[axis] * (D[:, None] * D)))
        b[block] = A[block, block] @ ((mean[axis] - reference[axis]) * D)
        root = np.sqrt(observations.information[:, axis])
        A[rows, axis * n] = root
        coloured = observations.error >= 0
        column = 3 + np.where(coloured, observations.error, 0)
        h = np.where(coloured, observations.coloured_std[:, axis], 0.0)
        if n > 3:
            A[rows, axis * n + column] += root * h
            h = h * reference[axis, column]
        b[rows] = root * (observations.z[:, axis] - reference[axis, 0] - h)
    return A, b
