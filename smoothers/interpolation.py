"""The state at any time, between and beyond the smoothed ones, from the white-jerk prior.

White-jerk motion is a Gaussian process with the Markov property: given its two neighbouring states, a
state in between is normal, with a mean linear in both. So interpolation is exact, covariance included,
given the covariance *between* the neighbours, which the smoother's gains carry. Given the motion at the
neighbours, neither the errors of the sensors nor the measurements say more about the motion in between.

Source: Barfoot, State Estimation for Robotics, ch. 3.4 and 11.
"""

from __future__ import annotations

import numpy as np

from jeat_graph.arrays import FloatArray
from jeat_graph.smoothers.track_data import MOTION, SmoothedTrack
from jeat_graph.smoothers.transitions import motion_matrices


def bridge(since: FloatArray, span: FloatArray, q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Conditional distribution of a state given the states before and after it.

    With Ψ = Q(τ) F(T - τ)ᵀ Q(T)⁻¹ and Λ = F(τ) - Ψ F(T), the state is Λ x₀ + Ψ x₁ plus noise of
    covariance Σ = Q(τ) - Ψ F(T - τ) Q(τ). Computed in units of T, where nothing is badly conditioned.

    Args:
        since: (N,) time τ since the state before (s).
        span: (N,) time T between the two states (s), >= τ, > 0.
        q: (N,) root spectral density of the jerk in that interval (px/s^2.5).

    Returns:
        Λ (N, 3, 3), Ψ (N, 3, 3) and Σ (N, 3, 3), for states [p, v, a] of one axis in px and s.
    """
    ones = np.ones_like(span)
    F_before, Q_before = motion_matrices(since / span, ones)
    F_after, _ = motion_matrices(1.0 - since / span, ones)
    F_whole, Q_whole = motion_matrices(ones, ones)
    across = Q_before @ F_after.transpose(0, 2, 1)
    Psi = np.linalg.solve(Q_whole, across.transpose(0, 2, 1)).transpose(0, 2, 1)
    Lambda = F_before - Psi @ F_whole
    Sigma = Q_before - Psi @ across.transpose(0, 2, 1)
    units = np.stack([ones, 1.0 / span, 1.0 / span**2], axis=1)
    convert = units[:, :, None] / units[:, None, :]
    density = (q**2 * span**5)[:, None, None] * units[:, :, None] * units[:, None, :]
    return Lambda * convert, Psi * convert, Sigma * density


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
    mean = np.empty((len(query), 2, 3))
    cov = np.empty((len(query), 2, 3, 3))
    right = np.searchsorted(track.t, query)
    means, covs = track.motion()
    exact = (right < len(track)) & (track.t[np.minimum(right, len(track) - 1)] == query)
    mean[exact], cov[exact] = means[right[exact]], covs[right[exact]]

    late = right == len(track)
    if late.any():
        mean[late], cov[late] = _extrapolate(track, len(track) - 1, query[late] - track.t[-1])
    early = (right == 0) & ~exact
    if early.any():
        mean[early], cov[early] = _extrapolate(track, 0, query[early] - track.t[0])

    inside = ~(exact | late | early)
    if inside.any():
        k1 = right[inside]
        k0 = k1 - 1
        start = track.t[k0]
        L, S, noise = bridge(query[inside] - start, track.t[k1] - start, track.q[k1])
        L, S = L[:, None], S[:, None]
        mean[inside] = (L @ means[k0, :, :, None] + S @ means[k1, :, :, None])[..., 0]
        between = track.gain[k0, :, :MOTION] @ track.cov[k1, :, :, :MOTION]
        crossed = L @ between @ S.swapaxes(-1, -2)
        cov[inside] = (
            L @ covs[k0] @ L.swapaxes(-1, -2)
            + S @ covs[k1] @ S.swapaxes(-1, -2)
            + crossed
            + crossed.swapaxes(-1, -2)
            + noise[:, None]
        )
    return mean, cov


def _extrapolate(track: SmoothedTrack, key: int, ahead: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Predict from one end by `ahead` (N,) seconds, all > 0 after the last key or < 0 before the first."""
    neighbour = min(max(key, 1), len(track) - 1)
    F, Q = motion_matrices(np.abs(ahead), np.full(len(ahead), track.q[neighbour]))
    means, covs = track.motion()
    cov = covs[key][None]
    if ahead[0] < 0:
        # x₀ = F⁻¹ (x₁ - w), and F(Δ)⁻¹ = F(-Δ).
        F, _ = motion_matrices(ahead, np.zeros(len(ahead)))
        cov, Q = cov + Q[:, None], np.zeros_like(Q)
    F = F[:, None]
    mean = (F @ means[key][None, :, :, None])[..., 0]
    return mean, F @ cov @ F.swapaxes(-1, -2) + Q[:, None]
