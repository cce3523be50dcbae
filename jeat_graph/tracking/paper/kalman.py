"""The adaptive Kalman filter of all tracks at once (paper sections B, C and E)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from jeat_graph.config.paper import PaperConfig
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.tracking.paper.state import Found, PaperTracks

#: Dimension n_z of a measured centre (paper eq. 6).
MEASURED = 2


def motion_model(dt: FloatArray | float, jerk: float) -> tuple[FloatArray, FloatArray]:
    """Return transition F and process noise Q of [p, v, a] (paper eq. 2).

    F = [[1, Δ, Δ²/2], [0, 1, Δ], [0, 0, 1]],
    Q = σ_j² [[Δ⁵/20, Δ⁴/8, Δ³/6], [Δ⁴/8, Δ³/3, Δ²/2], [Δ³/6, Δ²/2, Δ]].

    Args:
        dt: (...) time steps Δ (s), of any sign for F.
        jerk: root spectral density σ_j of the white jerk (px/s^2.5).

    Returns:
        (..., 3, 3) both.
    """
    d = np.asarray(dt, dtype=np.float64)
    one, zero = np.ones_like(d), np.zeros_like(d)
    F = np.stack([one, d, d * d / 2, zero, one, d, zero, zero, one], axis=-1)
    p5, p4, p3, p2 = d**5 / 20, d**4 / 8, d**3, d**2 / 2
    Q = jerk**2 * np.stack([p5, p4, p3 / 6, p4, p3 / 3, p2, p3 / 6, p2, d], axis=-1)
    return F.reshape(*d.shape, 3, 3), Q.reshape(*d.shape, 3, 3)


def size_model(dt: FloatArray | float, density: float) -> tuple[FloatArray, FloatArray]:
    """Return F and Q of [ln s, rate]: a rate driven by white noise of root density q (1/s^1.5).

    F = [[1, Δ], [0, 1]], Q = q² [[Δ³/3, Δ²/2], [Δ²/2, Δ]].

    Args:
        dt: (...) time steps Δ (s).
        density: q.

    Returns:
        (..., 2, 2) both.
    """
    d = np.asarray(dt, dtype=np.float64)
    one, zero = np.ones_like(d), np.zeros_like(d)
    F = np.stack([one, d, zero, one], axis=-1)
    Q = density**2 * np.stack([d**3 / 3, d**2 / 2, d**2 / 2, d], axis=-1)
    return F.reshape(*d.shape, 2, 2), Q.reshape(*d.shape, 2, 2)


def move(mean: FloatArray, cov: FloatArray, F: FloatArray, Q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Predict states: m ← F m, P ← F P Fᵀ + Q (paper eq. 2).

    Args:
        mean: (N, A, D) of A axes.
        cov: (N, D, D).
        F: (D, D).
        Q: (D, D).
    """
    return mean @ F.T, F @ cov @ F.T + Q


def predict(tracks: PaperTracks, dt: float, config: PaperConfig) -> PaperTracks:
    """Predict all tracks by `dt` seconds (paper eq. 2); what the step before used is forgotten."""
    used = np.zeros(len(tracks), dtype=np.int64)
    if dt <= 0.0 or not len(tracks):
        return replace(tracks, used=used)
    mean, cov = move(tracks.mean, tracks.cov, *motion_model(dt, config.jerk_px))
    size_model_now = size_model(dt, config.size_rate_density)
    size_mean, size_cov = move(tracks.size_mean, tracks.size_cov, *size_model_now)
    return replace(tracks, mean=mean, cov=cov, size_mean=size_mean, size_cov=size_cov, used=used)


def transition(dt: float) -> FloatArray:
    """Return the transition (5, 5) of motion and size over `dt` seconds."""
    out = np.eye(5)
    if dt > 0.0:
        out[:3, :3], out[3:, 3:] = motion_model(dt, 0.0)[0], size_model(dt, 0.0)[0]
    return out


def correct(
    mean: FloatArray, cov: FloatArray, z: FloatArray, R: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Take in measurements of the first component of each axis (paper eq. 4).

    The Joseph form (I − K H) P (I − K H)ᵀ + K R Kᵀ is written out for H = [1, 0, …]: the measured row
    becomes P_0j R / S, a product, and the others P_ij − P_0i P_0j / S.

    Args:
        mean: (K, A, D).
        cov: (K, D, D).
        z: (K, A).
        R: (K,) > 0.

    Returns:
        mean and covariance after it, and the normalised innovation squared Σ y² / S (K,).
    """
    seen = cov[:, 0]
    S = seen[:, 0] + R
    gain, y = seen / S[:, None], z - mean[:, :, 0]
    after = cov - gain[:, :, None] * seen[:, None, :]
    after[:, 0] = after[:, :, 0] = seen * (R / S)[:, None]
    return mean + y[:, :, None] * gain[:, None], after, (y * y).sum(axis=1) / S


def noise_of(tracks: PaperTracks, row: IntArray, found: Found, detection: IntArray) -> FloatArray:
    """Return R = s R_base g(p) (K,) of detections of tracks, along either axis (px²)."""
    return tracks.scale[row, found.sensor[detection]] * found.noise[detection]


def adapted(scale: FloatArray, nis: FloatArray, config: PaperConfig) -> FloatArray:
    """Return the factors s (K,) on noise after an update (paper eq. 6).

    s ← max(s_min, min(s (1 + η (ε / n_z − 1)), s_max)).

    Args:
        scale: (K,) before it.
        nis: (K,) normalised innovations squared ε.
        config: η, s_min and s_max.
    """
    grown = scale * (1.0 + config.adaptation_rate * (nis / MEASURED - 1.0))
    return np.clip(grown, config.scale_min, config.scale_max)


def update(
    tracks: PaperTracks, row: IntArray, found: Found, detection: IntArray, t: float, config: PaperConfig
) -> PaperTracks:
    """Let tracks take detections in (paper eq. 4 and 6).

    Args:
        tracks: predicted to the time of the detections.
        row: (K,) rows of the tracks, none twice.
        found: all detections of the step.
        detection: (K,) the one that each takes.
        t: time of the step (s).
        config: settings.
    """
    if not len(row):
        return tracks
    new = {name: getattr(tracks, name).copy() for name in _WRITTEN}
    R, sensor = noise_of(tracks, row, found, detection), found.sensor[detection]
    motion = correct(tracks.mean[row], tracks.cov[row], found.z[detection], R)
    new["mean"][row], new["cov"][row], nis = motion
    size = tracks.size_mean[row], tracks.size_cov[row]
    taken = correct(*size, found.log_size[detection], found.log_size_var[detection])
    new["size_mean"][row], new["size_cov"][row], _ = taken
    new["scale"][row, sensor] = adapted(tracks.scale[row, sensor], nis, config)
    new["hits"][row] += 1
    new["t_update"][row] = t
    new["used"][row] |= np.left_shift(1, sensor)
    return replace(tracks, **new)


_WRITTEN = ("mean", "cov", "size_mean", "size_cov", "scale", "hits", "t_update", "used")


def born(
    found: Found, detection: IntArray, t: float, first_id: int, sensors: int, config: PaperConfig
) -> PaperTracks:
    """Start a track at each of some detections (K,): at rest, as surely as the settings say."""
    n = len(detection)
    mean, size_mean = np.zeros((n, 2, 3)), np.zeros((n, 2, 2))
    cov, size_cov = np.zeros((n, 3, 3)), np.zeros((n, 2, 2))
    mean[:, :, 0], size_mean[:, :, 0] = found.z[detection], found.log_size[detection]
    cov[:, 0, 0], size_cov[:, 0, 0] = found.noise[detection], found.log_size_var[detection]
    cov[:, 1, 1], cov[:, 2, 2] = config.velocity_std_px**2, config.acceleration_std_px**2
    size_cov[:, 1, 1] = config.size_rate_std**2
    return PaperTracks(
        track_id=first_id + np.arange(n),
        mean=mean,
        cov=cov,
        size_mean=size_mean,
        size_cov=size_cov,
        scale=np.ones((n, sensors)),
        t_birth=np.full(n, t),
        t_update=np.full(n, t),
        hits=np.ones(n, dtype=np.int64),
        confirmed=np.zeros(n, dtype=np.bool_),
        used=np.left_shift(1, found.sensor[detection]),
    )
