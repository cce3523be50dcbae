"""Rauch-Tung-Striebel smoothing, compiled: the exact oracle of the others, and the cheap engine.

Forward a Kalman filter, back the smoother; both covariance updates are sums of congruences (Joseph
form), so that no rounding makes a covariance indefinite. All tracks of a batch run in one call.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit

from jeat_graph.arrays import FloatArray, IntArray
from jeat_graph.filters.motion import process_noise, transition
from jeat_graph.smoothers.track_data import SmoothedTrack, TrackData


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


@njit(cache=True)
def _update(m: FloatArray, P: FloatArray, z: float, info: float) -> None:
    """Joseph update of one axis, in place, by a position `z` of information `info` (1/variance)."""
    n = len(m)
    r = 1.0 / info
    K = P[:, 0] / (P[0, 0] + r)
    innovation = z - m[0]
    row = P[0].copy()
    corner = row[0] + r
    for i in range(n):
        m[i] += K[i] * innovation
        for j in range(n):
            # (I - K H) P (I - K H)ᵀ + K r Kᵀ written out for H = [1, 0, ...].
            P[i, j] += -K[i] * row[j] - row[i] * K[j] + K[i] * corner * K[j]


@njit(cache=True)
def _solve_positive(A: FloatArray, B: FloatArray) -> None:
    """Overwrite B (n, n) with A⁻¹ B for a symmetric positive definite A (n, n), by LDLᵀ without pivots."""
    n = len(A)
    L = np.eye(n)
    d = np.empty(n)
    for j in range(n):
        d[j] = A[j, j]
        for k in range(j):
            d[j] -= L[j, k] * L[j, k] * d[k]
        for i in range(j + 1, n):
            s = A[i, j]
            for k in range(j):
                s -= L[i, k] * L[j, k] * d[k]
            L[i, j] = s / d[j]
    for c in range(n):
        for i in range(n):
            for k in range(i):
                B[i, c] -= L[i, k] * B[k, c]
        for i in range(n - 1, -1, -1):
            B[i, c] /= d[i]
            for k in range(i + 1, n):
                B[i, c] -= L[k, i] * B[k, c]


@njit(cache=True)
def _congruence(A: FloatArray, P: FloatArray, out: FloatArray) -> None:
    """Write A P Aᵀ, symmetric, into `out` (n, n)."""
    n = len(A)
    for i in range(n):
        for j in range(i + 1):
            s = 0.0
            for k in range(n):
                for m in range(n):
                    s += A[i, k] * P[k, m] * A[j, m]
            out[i, j] = s
            out[j, i] = s


@njit(cache=True)
def forward(
    F: FloatArray,
    Q: FloatArray,
    z: FloatArray,
    info: FloatArray,
    start: IntArray,
    prior_mean: FloatArray,
    prior_cov: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Kalman filter of many tracks whose keys lie one after the other (paper eq. 2 to 4).

    Args:
        F: (N, n, n) transition from the key before; not used at the first key of a track.
        Q: (N, n, n) process noise of that step.
        z: (N, A) measurement of the first component, per axis.
        info: (N, A) its information (1/variance); 0 where there is no measurement.
        start: (T + 1,) first key of each track, and N.
        prior_mean: (T, A, n) prior at the first key of each track.
        prior_cov: (T, A, n, n) its covariance.

    Returns:
        (N, A, n) filtered means and (N, A, n, n) filtered covariances.
    """
    N, axes = z.shape
    n = F.shape[1]
    mean = np.empty((N, axes, n))
    cov = np.empty((N, axes, n, n))
    for track in range(len(start) - 1):
        for k in range(start[track], start[track + 1]):
            for a in range(axes):
                m, P = mean[k, a], cov[k, a]
                if k == start[track]:
                    m[:] = prior_mean[track, a]
                    P[:] = prior_cov[track, a]
                else:
                    for i in range(n):
                        m[i] = 0.0
                        for j in range(n):
                            m[i] += F[k, i, j] * mean[k - 1, a, j]
                    _congruence(F[k], cov[k - 1, a], P)
                    P += Q[k]
                if info[k, a] > 0.0:
                    _update(m, P, z[k, a], info[k, a])
    return mean, cov


@njit(cache=True)
def backward(
    F: FloatArray, Q: FloatArray, start: IntArray, filtered_mean: FloatArray, filtered_cov: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rauch-Tung-Striebel pass (AIAA Journal 3(8), 1965), covariance in Joseph form.

    G = P Fᵀ (F P Fᵀ + Q)⁻¹;  P_s = (I - G F) P (I - G F)ᵀ + G (P_s⁺ + Q) Gᵀ.

    Args:
        F: (N, n, n) transition from the key before.
        Q: (N, n, n) process noise of that step.
        start: (T + 1,) first key of each track, and N.
        filtered_mean: (N, A, n) filtered means.
        filtered_cov: (N, A, n, n) filtered covariances.

    Returns:
        (N, A, n) smoothed means, (N, A, n, n) covariances, and (N, A, n, n) gains; the gain in row k
        is of the step from k to k + 1, and zero at the last key of a track.
    """
    N, axes, n = filtered_mean.shape
    mean = filtered_mean.copy()
    cov = filtered_cov.copy()
    gain = np.zeros((N, axes, n, n))
    predicted = np.empty((n, n))
    B = np.empty((n, n))
    left = np.empty((n, n))
    part = np.empty((n, n))
    residual = np.empty(n)
    for track in range(len(start) - 1):
        for k in range(start[track + 1] - 2, start[track] - 1, -1):
            step = F[k + 1]
            for a in range(axes):
                P, G = filtered_cov[k, a], gain[k, a]
                _congruence(step, P, predicted)
                predicted += Q[k + 1]
                for i in range(n):
                    for j in range(n):
                        s = 0.0
                        for m in range(n):
                            s += step[i, m] * P[m, j]
                        B[i, j] = s
                _solve_positive(predicted, B)  # B = (F P Fᵀ + Q)⁻¹ F P = Gᵀ
                for i in range(n):
                    residual[i] = mean[k + 1, a, i]
                    for j in range(n):
                        G[i, j] = B[j, i]
                        residual[i] -= step[i, j] * filtered_mean[k, a, j]
                for i in range(n):
                    for j in range(n):
                        mean[k, a, i] += G[i, j] * residual[j]
                        left[i, j] = 1.0 if i == j else 0.0
                        for m in range(n):
                            left[i, j] -= G[i, m] * step[m, j]
                _congruence(left, P, cov[k, a])
                _congruence(G, cov[k + 1, a] + Q[k + 1], part)
                cov[k, a] += part
    return mean, cov, gain


def _stack(tracks: Sequence[TrackData]) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return F (N, 3, 3), Q (N, 3, 3) of all keys of all tracks, and where each track starts (T + 1,)."""
    start = np.concatenate([[0], np.cumsum([len(track) for track in tracks])]).astype(np.int64)
    t = np.concatenate([track.t for track in tracks])
    dt = np.diff(t, prepend=t[0])
    dt[start[:-1]] = 0.0
    F, Q = motion_matrices(dt, np.concatenate([track.q for track in tracks]))
    return F, Q, start


def filter_track(track: TrackData, weights: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
    """Kalman filter of one track: the causal estimate that a smoother is compared with.

    Args:
        track: the data.
        weights: (M,) factor on the information of each measurement, 1 where None.

    Returns:
        (K, 2, 3) filtered means and (K, 2, 3, 3) covariances.
    """
    F, Q, start = _stack([track])
    z, info = track.fused(weights)
    return forward(F, Q, z, info, start, track.prior_mean[None], track.prior_cov[None])


def smooth_rts(track: TrackData, weights: FloatArray | None = None) -> SmoothedTrack:
    """Smooth one whole track, exactly.

    Args:
        track: the data.
        weights: (M,) factor on the information of each measurement, 1 where None.

    Returns:
        The smoothed states at all keys, with covariances and gains.
    """
    return smooth_rts_batch([track], None if weights is None else [weights])[0]


def smooth_rts_batch(
    tracks: Sequence[TrackData], weights: Sequence[FloatArray] | None = None
) -> list[SmoothedTrack]:
    """Smooth many whole tracks in one compiled call.

    Args:
        tracks: the data, T tracks.
        weights: for each track (M,) factors on the information of its measurements, 1 where None.

    Returns:
        T smoothed tracks, in the order given.
    """
    if not tracks:
        return []
    F, Q, start = _stack(tracks)
    fused = [track.fused(None if weights is None else weights[i]) for i, track in enumerate(tracks)]
    filtered_mean, filtered_cov = forward(
        F,
        Q,
        np.concatenate([z for z, _ in fused]),
        np.concatenate([info for _, info in fused]),
        start,
        np.stack([track.prior_mean for track in tracks]),
        np.stack([track.prior_cov for track in tracks]),
    )
    mean, cov, gain = backward(F, Q, start, filtered_mean, filtered_cov)
    return [
        SmoothedTrack(track.t, track.q, mean[a:b], cov[a:b], gain[a:b])
        for track, a, b in zip(tracks, start[:-1], start[1:], strict=True)
    ]
