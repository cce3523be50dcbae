"""Coloured measurement noise: the part of a detection's error that is still there in the next scan.

A detector takes the same shadow for bumper in frame after frame. A filter that takes such errors for white
averages them away on paper only: its covariance becomes far too small, and the slow wander of the boxes is
taken for motion. Here each sensor whose errors are correlated in time adds one state per axis to every track,
an error e of unit variance that forgets exponentially (a Gauss-Markov process), and the measurement is

    z = p + h e + w,  h² = c s R_base,  var w = (1 - c) s R_base / g,

with c the share of the variance that is coloured and h the standard deviation of that part. Source: shaping
filter and state augmentation, Bryson, Johansen, "Linear filtering for time-varying systems using measurements
containing colored noise", IEEE T-AC 10(1), 1965.

A block of state is [p, v, a, e_1, …, e_B]; with B = 0 it is the paper's.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.kalman import flush, update_block

#: Components of motion in a block, before the errors: p, v, a.
MOTION = 3


@njit(cache=True)
def predict_errors(mean: FloatArray, cov: FloatArray, correlation_time: FloatArray, dt: float) -> None:
    """Predict the errors by `dt` seconds, in place; `kalman.predict` does the motion.

    e ← φ e with φ = exp(−Δ / τ) and process noise 1 − φ²; the covariance with the motion is F P φ.

    Args:
        mean: (N, 2, 3 + B) per axis [p, v, a, e_1, …].
        cov: (N, 2, 3 + B, 3 + B).
        correlation_time: (B,) τ (s).
        dt: time step (s), >= 0.
    """
    B = len(correlation_time)
    h = 0.5 * dt * dt
    phi = np.empty(B)
    for b in range(B):
        phi[b] = math.exp(-dt / correlation_time[b])
    for i in range(mean.shape[0]):
        for k in range(2):
            m, P = mean[i, k], cov[i, k]
            for b in range(B):
                e = MOTION + b
                m[e] *= phi[b]
                p0, p1, p2 = P[0, e], P[1, e], P[2, e]
                P[0, e] = P[e, 0] = flush(phi[b] * (p0 + dt * p1 + h * p2))
                P[1, e] = P[e, 1] = flush(phi[b] * (p1 + dt * p2))
                P[2, e] = P[e, 2] = flush(phi[b] * p2)
                for c in range(b):
                    o = MOTION + c
                    P[e, o] = P[o, e] = flush(phi[b] * phi[c] * P[e, o])
                P[e, e] = phi[b] * phi[b] * (P[e, e] - 1.0) + 1.0


@njit(cache=True)
def expected(m: FloatArray, P: FloatArray, coloured_std: float, error: int) -> tuple[float, float]:
    """Mean and variance of a detection's position before its white noise, p + h e.

    Args:
        m: (3 + B,) mean of one axis.
        P: (3 + B, 3 + B) covariance.
        coloured_std: h (px).
        error: the sensor's error state, counted from 0; -1 where its errors are white.
    """
    if error < 0:
        return float(m[0]), float(P[0, 0])
    e = MOTION + error
    return (
        float(m[0] + coloured_std * m[e]),
        float(P[0, 0] + 2.0 * coloured_std * P[0, e] + coloured_std * coloured_std * P[e, e]),
    )


@njit(cache=True)
def update_with_error(
    m: FloatArray, P: FloatArray, z: float, R: float, coloured_std: float, error: int, u: FloatArray
) -> float:
    """Update one axis with a measurement z = p + h e + w, in place.

    With u = P Hᵀ and S = H u + R, P ← P − u uᵀ / S. The row of the position is written as
    u_j (h u_e + R) / S − h P_ej, which is the same and does not subtract numbers as large as the position's
    variance after a long gap (compare `kalman.update_block`).

    Args:
        m: (3 + B,) mean.
        P: (3 + B, 3 + B) covariance, symmetric.
        z: measured position (px).
        R: variance of its white part (px²), > 0.
        coloured_std: h (px).
        error: the sensor's error state, counted from 0, or -1.
        u: (3 + B,) workspace.

    Returns:
        The axis' share of the normalised innovation squared, y² / S.
    """
    D = len(m)
    # Without an error state there may be none in the block either.
    e, h = (MOTION + error, coloured_std) if error >= 0 else (0, 0.0)
    for j in range(D):
        u[j] = P[0, j] + h * P[e, j]
    S = u[0] + h * u[e] + R
    y = z - m[0] - h * m[e]
    kept = (h * u[e] + R) / S
    for j in range(D):
        m[j] += u[j] / S * y
        P[0, j] = flush(u[j] * kept - h * P[e, j])
    for i in range(1, D):
        P[i, 0] = P[0, i]
        for j in range(i, D):
            P[i, j] = flush(P[i, j] - u[i] / S * u[j])
            P[j, i] = P[i, j]
    return float(y * y / S)


@njit(cache=True)
def update_centre(
    mean: FloatArray, cov: FloatArray, z: FloatArray, R: FloatArray, coloured_std: FloatArray, error: int
) -> float:
    """Update one track with a measurement of its box centre, in place (paper eq. 4, with coloured noise).

    Args:
        mean: (2, 3 + B) per axis [p, v, a, e_1, …].
        cov: (2, 3 + B, 3 + B).
        z: (2,) measured centre (px).
        R: (2,) variances of the white part (px²).
        coloured_std: (2,) h per axis (px).
        error: the sensor's error state, counted from 0, or -1.

    Returns:
        The normalised innovation squared, χ² with 2 degrees of freedom for a consistent filter.
    """
    nis = 0.0
    if mean.shape[1] == MOTION:
        for k in range(2):
            nis += update_block(mean[k], cov[k], z[k], R[k])
        return nis
    u = np.empty(mean.shape[1])
    for k in range(2):
        nis += update_with_error(mean[k], cov[k], z[k], R[k], coloured_std[k], error, u)
    return nis
