"""The state at any time, between and beyond the smoothed ones, from the white-jerk prior.

White-jerk motion is a Gaussian process with the Markov property: given its two neighbouring states, a
state in between is normal, with a mean linear in both. So interpolation is exact, covariance included,
given the covariance *between* the neighbours, which the smoother's gains carry. Given the motion at the
neighbours, neither the errors of the sensors nor the measurements say more about the motion in between.

Source: Barfoot, State Estimation for Robotics, ch. 3.4 and 11.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.motion import process_noise, transition
from jeat_graph.smoothers.small_matrices import product
from jeat_graph.smoothers.track_data import SmoothedTrack
from jeat_graph.smoothers.transitions import motion_matrices

# Transition over a unit of time, and the inverse of its process noise, which is one of integers.
_WHOLE = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
_WHOLE_INVERSE = np.array([[720.0, -360.0, 60.0], [-360.0, 192.0, -36.0], [60.0, -36.0, 9.0]])

#: Between states closer than this (s) the bridge of the prior is not asked: what jerk does in a
#: millisecond is nothing beside what is known of a state, while the bridge's factors, of order 1 / T², make
#: thousands of px/s² of the last digits of a position.
SHORT_S = 1e-3


@njit(cache=True)
def bridge(since: float, span: float, jerk: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Conditional distribution of a state given the states before and after it.

    With Ψ = Q(τ) F(T - τ)ᵀ Q(T)⁻¹ and Λ = F(τ) - Ψ F(T), the state is Λ x₀ + Ψ x₁ plus noise of
    covariance Σ = Q(τ) - Ψ F(T - τ) Q(τ). Computed in units of T, where nothing is badly conditioned.

    Args:
        since: time τ since the state before (s).
        span: time T between the two states (s), >= τ, > 0.
        jerk: root spectral density of the jerk in that interval (px/s^2.5).

    Returns:
        Λ (3, 3), Ψ (3, 3) and Σ (3, 3), for states [p, v, a] of one axis in px and s.
    """
    s = since / span
    Q = process_noise(s, 1.0)
    across = product(Q, transition(1.0 - s).T)
    Psi = product(across, _WHOLE_INVERSE)
    Lambda = transition(s) - product(Psi, _WHOLE)
    Sigma = Q - product(Psi, across.T)
    units = (1.0, 1.0 / span, 1.0 / (span * span))
    density = jerk * jerk * span * span * span * span * span
    for i in range(3):
        for j in range(3):
            Lambda[i, j] *= units[i] / units[j]
            Psi[i, j] *= units[i] / units[j]
            Sigma[i, j] *= density * units[i] * units[j]
    return Lambda, Psi, Sigma


def interpolate(track: SmoothedTrack, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the motion at any times, with covariances; beyond the ends by prediction, forth or back.

    At a key the result is the key's own position, velocity and acceleration.

    Args:
        track: the smoothed states, at least one.
        t: (N,) times (s), in any order.

    Returns:
        (N, 2, 3) means (px, px/s, px/s²) and (N, 2, 3, 3) covariances.
    """
    query = np.asarray(t, dtype=np.float64).reshape(-1)
    mean, cov = _between(track.t, track.jerk, track.mean, track.cov, track.gain, query)
    late = query > track.t[-1]
    if late.any():
        mean[late], cov[late] = _extrapolate(track, len(track) - 1, query[late] - track.t[-1])
    early = query < track.t[0]
    if early.any():
        mean[early], cov[early] = _extrapolate(track, 0, query[early] - track.t[0])
    return mean, cov


@njit(cache=True)
def _between(
    t: FloatArray, jerk: FloatArray, mean: FloatArray, cov: FloatArray, gain: FloatArray, query: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Fill in `interpolate`'s result (N, 2, 3), (N, 2, 3, 3) where a time is not beyond the ends."""
    out_mean, out_cov = np.empty((len(query), 2, 3)), np.empty((len(query), 2, 3, 3))
    keys, k1 = len(t), 0
    for i in range(len(query)):
        if k1 == keys or t[k1] < query[i] or (k1 > 0 and t[k1 - 1] >= query[i]):
            k1 = np.searchsorted(t, query[i])
        if k1 == keys or query[i] < t[0]:
            continue
        if t[k1] == query[i]:
            out_mean[i] = mean[k1, :, :3]
            out_cov[i] = cov[k1, :, :3, :3]
            continue
        k0 = k1 - 1
        if t[k1] - t[k0] < SHORT_S:
            _blend(t, mean, cov, k0, query[i], out_mean[i], out_cov[i])
            continue
        L, S, noise = bridge(query[i] - t[k0], t[k1] - t[k0], jerk[k1])
        for a in range(2):
            # [Λ Ψ] times the joint covariance of both ends, whose mixed block is the gain's.
            cross = product(gain[k0, a, :3], cov[k1, a, :, :3])
            left = product(L, cov[k0, a, :3, :3]) + product(S, cross.T)
            right = product(L, cross) + product(S, cov[k1, a, :3, :3])
            whole = product(left, L.T) + product(right, S.T) + noise
            for r in range(3):
                m = 0.0
                for c in range(3):
                    m += L[r, c] * mean[k0, a, c] + S[r, c] * mean[k1, a, c]
                    out_cov[i, a, r, c] = 0.5 * (whole[r, c] + whole[c, r])
                out_mean[i, a, r] = m
    return out_mean, out_cov


@njit(cache=True)
def _blend(
    t: FloatArray, mean: FloatArray, cov: FloatArray, k: int, query: float, out: FloatArray, var: FloatArray
) -> None:
    """Write the state between the close neighbours k and k + 1: each moved there, weighed by nearness.

    A mixture of two covariances F P Fᵀ has no differences in it, so that no rounding makes it indefinite.
    """
    share = (query - t[k]) / (t[k + 1] - t[k])
    out[:] = 0.0
    var[:] = 0.0
    for side in range(2):
        weight = share if side else 1.0 - share
        dt = query - t[k + side]
        half = 0.5 * dt * dt
        for a in range(2):
            m, P = mean[k + side, a], cov[k + side, a]
            out[a, 0] += weight * (m[0] + dt * m[1] + half * m[2])
            out[a, 1] += weight * (m[1] + dt * m[2])
            out[a, 2] += weight * m[2]
            moved = np.empty((3, 3))
            for c in range(3):
                moved[0, c] = P[0, c] + dt * P[1, c] + half * P[2, c]
                moved[1, c] = P[1, c] + dt * P[2, c]
                moved[2, c] = P[2, c]
            for r in range(3):
                var[a, r, 0] += weight * (moved[r, 0] + dt * moved[r, 1] + half * moved[r, 2])
                var[a, r, 1] += weight * (moved[r, 1] + dt * moved[r, 2])
                var[a, r, 2] += weight * moved[r, 2]


def _extrapolate(track: SmoothedTrack, key: int, ahead: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Predict from one end by `ahead` (N,) seconds, all > 0 after the last key or < 0 before the first."""
    neighbour = min(max(key, 1), len(track) - 1)
    F, Q = motion_matrices(np.abs(ahead), np.full(len(ahead), track.jerk[neighbour]))
    means, covs = track.motion()
    cov = covs[key][None]
    if ahead[0] < 0:
        # x₀ = F⁻¹ (x₁ - w), and F(Δ)⁻¹ = F(-Δ).
        F, _ = motion_matrices(ahead, np.zeros(len(ahead)))
        cov, Q = cov + Q[:, None], np.zeros_like(Q)
    F = F[:, None]
    mean = (F @ means[key][None, :, :, None])[..., 0]
    return mean, F @ cov @ F.swapaxes(-1, -2) + Q[:, None]
