"""The extended Kalman filter of all tracks at once (paper eq. 2, 4 and the innovation of eq. 5).

Arrays of tracks have one row a track; the functions change their first arguments in place, because the
state of all tracks lives in one preallocated block. The measurement is the box centre, so H picks the
position of each axis and every update is two scalar updates.
"""

from __future__ import annotations

import math

from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.motion import process_noise

# Below this a covariance entry is rounding dust; it would sink into subnormals, which slow every kernel.
_FLUSH = 1e-250


@njit(cache=True)
def predict(mean: FloatArray, cov: FloatArray, jerk: FloatArray, dt: float) -> None:
    """Predict all tracks by `dt` seconds, in place (paper eq. 2): m ← F m, P ← F P Fᵀ + Q.

    Args:
        mean: (N, 2, 3) per axis [p, v, a] (px, px/s, px/s²).
        cov: (N, 2, 3, 3) covariance per axis.
        jerk: (N,) root spectral density of each track's jerk (px/s^2.5).
        dt: time step (s), >= 0.
    """
    h = 0.5 * dt * dt
    Q = process_noise(dt, 1.0)
    for i in range(mean.shape[0]):
        q = jerk[i] * jerk[i]
        for k in range(2):
            m = mean[i, k]
            m[0] += dt * m[1] + h * m[2]
            m[1] += dt * m[2]
            P = cov[i, k]
            p00, p01, p02 = P[0, 0], P[0, 1], P[0, 2]
            p11, p12, p22 = P[1, 1], P[1, 2], P[2, 2]
            # Rows of F P, then the columns times Fᵀ; P is symmetric, so six entries do.
            a00 = p00 + dt * p01 + h * p02
            a01 = p01 + dt * p11 + h * p12
            a02 = p02 + dt * p12 + h * p22
            a11 = p11 + dt * p12
            a12 = p12 + dt * p22
            P[0, 0] = a00 + dt * a01 + h * a02 + q * Q[0, 0]
            P[0, 1] = a01 + dt * a02 + q * Q[0, 1]
            P[0, 2] = a02 + q * Q[0, 2]
            P[1, 1] = a11 + dt * a12 + q * Q[1, 1]
            P[1, 2] = a12 + q * Q[1, 2]
            P[2, 2] = p22 + q * Q[2, 2]
            P[1, 0] = P[0, 1]
            P[2, 0] = P[0, 2]
            P[2, 1] = P[1, 2]


@njit(cache=True)
def predict_size(mean: FloatArray, cov: FloatArray, density: FloatArray, dt: float) -> None:
    """Predict ln width and ln height of all tracks by `dt` seconds, in place.

    Args:
        mean: (N, 2, 2) per side [ln s, rate] (ln px, 1/s).
        cov: (N, 2, 2, 2) covariance per side.
        density: (N,) root spectral density of the rate's driving noise (1/s^1.5).
        dt: time step (s), >= 0.
    """
    for i in range(mean.shape[0]):
        # `size_process_noise`, written out.
        q = density[i] * density[i]
        q00, q01, q11 = q * dt * dt * dt / 3.0, 0.5 * q * dt * dt, q * dt
        for k in range(2):
            mean[i, k, 0] += dt * mean[i, k, 1]
            P = cov[i, k]
            p01 = P[0, 1] + dt * P[1, 1]
            P[0, 0] += dt * (P[0, 1] + p01) + q00
            P[0, 1] = p01 + q01
            P[1, 0] = P[0, 1]
            P[1, 1] += q11


@njit(cache=True)
def flush(value: float) -> float:
    """Return the value, or zero where it would sink into subnormals."""
    return 0.0 if abs(value) < _FLUSH else value


@njit(cache=True)
def update_block(m: FloatArray, P: FloatArray, z: float, R: float) -> float:
    """Update one block with a scalar measurement of its first component, in place (paper eq. 4).

    Joseph form, P ← (I − KH) P (I − KH)ᵀ + K R Kᵀ, written out for H = [1, 0, …] and K = P Hᵀ / S: the
    measured row is P_0j R / S, a product, and the others are P_ij − P_0i P_0j / S. Expanded term by term, the
    measured variance would be a difference of numbers as large as P_00, of which after a long gap only the
    rounding is left.

    Args:
        m: (D,) mean, D = 2 or 3.
        P: (D, D) covariance, symmetric.
        z: measurement of m[0].
        R: variance of the measurement, > 0.

    Returns:
        The block's share of the normalised innovation squared, y² / S.
    """
    # Entry by entry: a loop over a copied row allocates, and this is the innermost kernel of the tracker.
    p0, p1 = P[0, 0], P[0, 1]
    S = p0 + R
    y = z - m[0]
    K1 = p1 / S
    kept = R / S
    m[0] += p0 / S * y
    m[1] += K1 * y
    if m.shape[0] == 3:
        p2 = P[0, 2]
        K2 = p2 / S
        m[2] += K2 * y
        P[0, 2] = P[2, 0] = flush(p2 * kept)
        P[1, 2] = P[2, 1] = flush(P[1, 2] - K1 * p2)
        P[2, 2] = flush(P[2, 2] - K2 * p2)
    P[0, 0] = flush(p0 * kept)
    P[0, 1] = P[1, 0] = flush(p1 * kept)
    P[1, 1] = flush(P[1, 1] - K1 * p1)
    return float(y * y / S)


@njit(cache=True)
def log_gaussian(y: float, S: float) -> float:
    """Logarithm of the density of N(0, S) at `y`."""
    return float(-0.5 * (y * y / S + math.log(2.0 * math.pi * S)))
