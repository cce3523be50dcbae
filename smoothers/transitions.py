"""Motion and error states from one moment to the next.

A track's state is, per axis, [p, v, a, e_1, …, e_B]: white-jerk motion, and the errors of the coloured
sensors. An error state is a stationary Ornstein-Uhlenbeck process of unit variance that is correlated
over its correlation time τ: e(t + Δ) = exp(-Δ/τ) e(t) + noise of variance 1 - exp(-2Δ/τ).

Source: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001,
ch. 8 (autocorrelated noise as states of its own).

F has few entries, so what is compiled here writes its products out. `dims`, a tuple of n = 3 + B elements,
tells the size of a state to the compiler, which then unrolls the loops.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.motion import process_noise, transition

# Process noise of white jerk is q² Δ u_i u_j times this, with u = (Δ², Δ, 1) (paper eq. 2).
_UNIT_NOISE = np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])


@njit(cache=True)
def motion_matrices(dt: FloatArray, jerk: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Transition matrices and process noise of white-jerk motion (paper eq. 2) for many steps.

    Args:
        dt: (N,) time steps (s), >= 0; a step of 0 gives identity and zero.
        jerk: (N,) root spectral densities of the jerk (px/s^2.5).

    Returns:
        (N, 3, 3) transition matrices and (N, 3, 3) covariances.
    """
    F = np.empty((len(dt), 3, 3))
    Q = np.empty((len(dt), 3, 3))
    for i in range(len(dt)):
        F[i] = transition(dt[i])
        Q[i] = process_noise(dt[i], jerk[i])
    return F, Q


@njit(cache=True)
def error_steps(dt: float, correlation_time: FloatArray, phi: FloatArray, var: FloatArray) -> None:
    """Fill transition factors `phi` (B,) and noise variances `var` (B,) of the error states."""
    for b in range(len(correlation_time)):
        less = math.expm1(-dt / correlation_time[b])
        phi[b] = 1.0 + less
        var[b] = -less * (2.0 + less)


@njit(cache=True)
def step_mean(dims: tuple[int, ...], dt: float, phi: FloatArray, old: FloatArray, new: FloatArray) -> None:
    """Write F m (n,) of a filtered mean `old` into `new`."""
    half = 0.5 * dt * dt
    new[0] = old[0] + dt * old[1] + half * old[2]
    new[1] = old[1] + dt * old[2]
    new[2] = old[2]
    for i in range(3, len(dims)):
        new[i] = phi[i - 3] * old[i]


@njit(cache=True)
def step_cov(
    dims: tuple[int, ...],
    dt: float,
    jerk: float,
    phi: FloatArray,
    var: FloatArray,
    old: FloatArray,
    moved: FloatArray,
    new: FloatArray,
) -> None:
    """Write F P (n, n) of a filtered covariance `old` into `moved`, and F P Fᵀ + Q into `new`."""
    n = len(dims)
    half = 0.5 * dt * dt
    for j in range(n):
        moved[0, j] = old[0, j] + dt * old[1, j] + half * old[2, j]
        moved[1, j] = old[1, j] + dt * old[2, j]
        moved[2, j] = old[2, j]
        for i in range(3, n):
            moved[i, j] = phi[i - 3] * old[i, j]
    unit = jerk * jerk * dt
    d2 = dt * dt
    new[0, 0] = moved[0, 0] + dt * moved[0, 1] + half * moved[0, 2] + unit * d2 * d2 * _UNIT_NOISE[0, 0]
    new[1, 0] = moved[1, 0] + dt * moved[1, 1] + half * moved[1, 2] + unit * d2 * dt * _UNIT_NOISE[1, 0]
    new[2, 0] = moved[2, 0] + dt * moved[2, 1] + half * moved[2, 2] + unit * d2 * _UNIT_NOISE[2, 0]
    new[1, 1] = moved[1, 1] + dt * moved[1, 2] + unit * d2 * _UNIT_NOISE[1, 1]
    new[2, 1] = moved[2, 1] + dt * moved[2, 2] + unit * dt * _UNIT_NOISE[2, 1]
    new[2, 2] = moved[2, 2] + unit * _UNIT_NOISE[2, 2]
    for i in range(3, n):
        new[i, 0] = moved[i, 0] + dt * moved[i, 1] + half * moved[i, 2]
        new[i, 1] = moved[i, 1] + dt * moved[i, 2]
        new[i, 2] = moved[i, 2]
        for j in range(3, i + 1):
            new[i, j] = moved[i, j] * phi[j - 3]
        new[i, i] += var[i - 3]
    for i in range(n):
        for j in range(i):
            new[j, i] = new[i, j]
