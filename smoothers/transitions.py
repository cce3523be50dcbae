"""Motion and error states from one moment to the next, as matrices.

A track's state is, per axis, [p, v, a, e_1, …, e_B]: white-jerk motion, and the errors of the coloured
sensors. An error state is a stationary Ornstein-Uhlenbeck process of unit variance that is correlated
over its memory τ: e(t + Δ) = exp(-Δ/τ) e(t) + noise of variance 1 - exp(-2Δ/τ).

Source: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001,
ch. 8 (autocorrelated noise as states of its own).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.arrays import FloatArray
from jeat_graph.filters.motion import process_noise, transition


@njit(cache=True)
def motion_matrices(dt: FloatArray, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Transition matrices and process noise of white-jerk motion (paper eq. 2) for many steps.

    Args:
        dt: (N,) time steps (s), >= 0; a step of 0 gives identity and zero.
        q: (N,) root spectral densities of the jerk (px/s^2.5).

    Returns:
        (N, 3, 3) transition matrices and (N, 3, 3) covariances.
    """
    F = np.empty((len(dt), 3, 3))
    Q = np.empty((len(dt), 3, 3))
    for i in range(len(dt)):
        F[i] = transition(dt[i])
        Q[i] = process_noise(dt[i], q[i])
    return F, Q
