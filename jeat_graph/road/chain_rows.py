"""Compiled factors of a vehicle's states: between two of them, what all boxes in between say is eliminated.

State: place, speed and acceleration across the road and along it, then the persisting error of each channel
of each sensor's boxes in its standard deviations. Jerks are white. The size is shared by all states.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.road.box_kernel import CHANNELS, UNKNOWNS, KernelCamera, box_channels, cuboid_sides
from jeat_graph.road.box_solver import BoxRows, measured

#: Components of the motion, and of the size.
MOTION, SIZES = 6, 3
_AXIS = 3


class LinearBoxes(NamedTuple):
    """Boxes about one trial motion and size.

    Attributes:
        J: (N, 4, 5) derivatives of the channels with respect to x, y, length, width, height.
        d: (N, 4) what was measured, less all that is not linear.
        weight: (N,) robust weights: a doubtful box is given more white noise.
    """

    J: FloatArray
    d: FloatArray
    weight: FloatArray


@njit(cache=True)
def linearise_at(
    camera: KernelCamera,
    rows: BoxRows,
    place: FloatArray,
    size: FloatArray,
    J: FloatArray,
    residual: FloatArray,
) -> bool:
    """Fill J (N, 4, 5) and residuals (N, 4) of cuboids at `place` (N, 3): x, y (m), heading (rad).

    Returns:
        Whether the vehicle is in front of the camera at all times.
    """
    side, slope, z = np.empty(4), np.empty((4, UNKNOWNS)), np.empty(CHANNELS)
    for k in range(len(rows.t)):
        if not cuboid_sides(camera, place[k, 0], place[k, 1], place[k, 2], size, side, slope):
            return False
        box_channels(side, slope, rows.mode[k], z, J[k])
        for channel in range(CHANNELS):
            residual[k, channel] = rows.z[k, channel] - z[channel]
    return True


@njit(cache=True)
def _step(dt: float, jerk: FloatArray, memory_s: FloatArray, A: FloatArray, P: FloatArray) -> None:
    """Predict by dt, in place: A (n, Q) is any number of states side by side, P (n, n) their covariance."""
    half = 0.5 * dt * dt
    for a in range(2):
        p = _AXIS * a
        for q in range(A.shape[1]):
            A[p, q] += dt * A[p + 1, q] + half * A[p + 2, q]
            A[p + 1, q] += dt * A[p + 2, q]
        for q in range(P.shape[1]):
            P[p, q] += dt * P[p + 1, q] + half * P[p + 2, q]
            P[p + 1, q] += dt * P[p + 2, q]
    for a in range(2):
        p = _AXIS * a
        for r in range(P.shape[0]):
            P[r, p] += dt * P[r, p + 1] + half * P[r, p + 2]
            P[r, p + 1] += dt * P[r, p + 2]
        q = jerk[a] * jerk[a]
        P[p, p] += q * dt**5 / 20.0
        P[p + 1, p + 1] += q * dt**3 / 3.0
        P[p + 2, p + 2] += q * dt
        for r, c, value in (
            (p, p + 1, q * dt**4 / 8.0),
            (p, p + 2, q * dt**3 / 6.0),
            (p + 1, p + 2, q * half),
        ):
            P[r, c] += value
            P[c, r] += value
    for g in range(len(memory_s)):
        forget = math.exp(-dt / memory_s[g])
        for e in range(MOTION + CHANNELS * g, MOTION + CHANNELS * (g + 1)):
            for q in range(A.shape[1]):
                A[e, q] *= forget
            for q in range(P.shape[1]):
                P[e, q] *= forget
            for r in range(P.shape[0]):
                P[r, e] *= forget
            P[e, e] += 1.0 - forget * forget


@njit(cache=True)
def chain_rows(
    keys: FloatArray, rows: BoxRows, boxes: LinearBoxes, jerk: FloatArray
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Whitened rows between neighbouring states.

    Let the first state of a pair be known, and the size. Then a Kalman filter gives the innovation of every
    box up to the second state, and in the end that state with its covariance; all of these are independent.
    Divided by their standard deviations they are the rows; motion comes first, being the heaviest.

    Args:
        keys: (K,) times of the states (s), the first not after the first box, the last not before the last.
        rows: the boxes with the sizes of their errors.
        boxes: their derivatives and right-hand sides.
        jerk: (2,) root spectral densities across and along the road (m/s^2.5).

    Returns:
        Rows (K - 1, R, 2 n + 4): on the first state, the second, the size, and right-hand sides; how many of
        each are used (K - 1,); logarithms of the determinants of their covariances (K - 1,).
    """
    n = MOTION + CHANNELS * len(rows.memory_s)
    K, wide = len(keys), n + SIZES + 1
    first = np.searchsorted(rows.t, keys[1:-1], side="right")
    bounds = np.empty(K, dtype=np.int64)
    bounds[0], bounds[-1] = 0, len(rows.t)
    bounds[1:-1] = first
    most = 0
    for s in range(K - 1):
        most = max(most, bounds[s + 1] - bounds[s])
    out = np.zeros((K - 1, n + CHANNELS * most, n + wide))
    counts, logs = np.full(K - 1, n), np.zeros(K - 1)
    P, H, seen, row = np.empty((n, n)), np.empty(n), np.empty(n), np.empty(wide)
    state = np.empty((n, wide))  # of the first state, the size, and constants
    for s in range(K - 1):
        state[:], P[:], t, place = 0.0, 0.0, keys[s], n
        for j in range(n):
            state[j, j] = 1.0
        for k in range(bounds[s], bounds[s + 1]):
            if rows.t[k] > t:
                _step(rows.t[k] - t, jerk, rows.memory_s, state, P)
                t = rows.t[k]
            for channel in range(CHANNELS):
                if not measured(rows.mode[k], channel):
                    continue
                h, white = rows.coloured[k, channel], rows.white[k, channel]
                white += (white + h * h) * (1.0 / max(boxes.weight[k], 1e-6) - 1.0)
                H[:] = 0.0
                H[0], H[_AXIS] = boxes.J[k, channel, 0], boxes.J[k, channel, 1]
                H[MOTION + CHANNELS * rows.group[k] + channel] = h
                seen[:] = P @ H
                S = H @ seen + white
                row[:] = H @ state
                for j in range(SIZES):
                    row[n + j] += boxes.J[k, channel, 2 + j]
                row[-1] = boxes.d[k, channel] - row[-1]
                root = 1.0 / math.sqrt(S)
                out[s, place, :n] = root * row[:n]
                out[s, place, 2 * n :] = root * row[n:]
                logs[s] += math.log(S)
                for j in range(n):
                    gain = seen[j] / S
                    for q in range(n + SIZES):
                        state[j, q] -= gain * row[q]
                    state[j, -1] += gain * row[-1]
                    for q in range(n):
                        P[j, q] -= gain * seen[q]
                place += 1
        _step(keys[s + 1] - t, jerk, rows.memory_s, state, P)
        L = np.linalg.cholesky(P)
        W = np.linalg.solve(L, np.eye(n))
        moved = W @ state
        out[s, :n, :n] = -moved[:, :n]
        out[s, :n, n : 2 * n] = W
        out[s, :n, 2 * n : 2 * n + SIZES] = -moved[:, n : n + SIZES]
        out[s, :n, -1] = moved[:, -1]
        for j in range(n):
            logs[s] += 2.0 * math.log(L[j, j])
        counts[s] = place
    return out, counts, logs
