"""Constant acceleration driven by white jerk, one axis at a time (paper eq. 2).

The axes x and y are independent of each other: F and Q are Kronecker products with I2 and every
measurement noise here is diagonal. So a track's state is kept as two blocks [p, v, a], and the
cross-axis covariances, exactly zero, are neither stored nor computed.
"""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray


def transition(dt: float) -> FloatArray:
    """Transition matrix of [p, v, a] over `dt` seconds (paper eq. 2).

    F = [[1, Δ, Δ²/2], [0, 1, Δ], [0, 0, 1]].

    Args:
        dt: time step (s).

    Returns:
        (3, 3) matrix.
    """
    F = np.eye(3)
    F[0, 1] = dt
    F[0, 2] = 0.5 * dt * dt
    F[1, 2] = dt
    return F


def process_noise(dt: float, jerk: float) -> FloatArray:
    """Covariance that white jerk adds to [p, v, a] over `dt` seconds (paper eq. 2).

    Q = σ_j² [[Δ⁵/20, Δ⁴/8, Δ³/6], [Δ⁴/8, Δ³/3, Δ²/2], [Δ³/6, Δ²/2, Δ]]
    (Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, ch. 6.2).

    Args:
        dt: time step (s), >= 0.
        jerk: root spectral density σ_j of the jerk (px/s^2.5).

    Returns:
        (3, 3) matrix.
    """
    q = jerk * jerk
    d2 = dt * dt
    d3 = d2 * dt
    Q = np.empty((3, 3))
    Q[0, 0] = q * d3 * d2 / 20.0
    Q[0, 1] = Q[1, 0] = q * d2 * d2 / 8.0
    Q[0, 2] = Q[2, 0] = q * d3 / 6.0
    Q[1, 1] = q * d3 / 3.0
    Q[1, 2] = Q[2, 1] = q * d2 / 2.0
    Q[2, 2] = q * dt
    return Q
