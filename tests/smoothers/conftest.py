"""Tracks whose truth is known, and an exact solution that shares no code with the smoothers."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from jeat_graph.smoothers.measurements import measurements
from jeat_graph.smoothers.track_data import Prior, SmoothedTrack, TrackData

SCALE = np.array([1.0, 0.05, 0.0025])


def transition(dt):
    return np.array([[1.0, dt, dt * dt / 2], [0, 1, dt], [0, 0, 1]])


def noise(dt, q):
    return (
        q
        * q
        * np.array(
            [
                [dt**5 / 20, dt**4 / 8, dt**3 / 6],
                [dt**4 / 8, dt**3 / 3, dt**2 / 2],
                [dt**3 / 6, dt**2 / 2, dt],
            ]
        )
    )


PRIOR_COV = np.tile(np.diag([9.0, 50.0**2, 30.0**2]), (2, 1, 1))


def joint_transition(dt, correlation_time):
    """Transition of [p, v, a, e_1, …]."""
    F = np.diag(np.concatenate([np.ones(3), np.exp(-dt / np.asarray(correlation_time))]))
    F[:3, :3] = transition(dt)
    return F


def joint_noise(dt, q, correlation_time):
    """Process noise of [p, v, a, e_1, …]."""
    Q = np.diag(np.concatenate([np.ones(3), 1.0 - np.exp(-2.0 * dt / np.asarray(correlation_time))]))
    Q[:3, :3] = noise(dt, q)
    return Q


def rows_of_measurements(track, axis):
    """Matrix (M, n K) of what each measurement sees of all states."""
    n, H = track.size, np.zeros((len(track.z), track.size * len(track)))
    for row, (key, error) in enumerate(zip(track.key, track.error, strict=True)):
        H[row, n * key] = 1.0
        if error >= 0:
            H[row, n * key + 3 + error] = track.coloured_std[row, axis]
    return H


def coloured_prior(mean, cov, count):
    """Prior (2, 3), (2, 3, 3) with `count` error states of their own stationary distribution."""
    joint = np.tile(np.eye(3 + count), (2, 1, 1))
    joint[:, :3, :3] = cov
    return np.concatenate([mean, np.zeros((2, count))], axis=1), joint


PRIOR_MEAN = np.array([[600.0, 10.0, 0.0], [300.0, -5.0, 0.0]])


CORRELATION_TIMES = (0.3, 0.08)


def harsh(seed: int = 0, n: int = 60, q: float = 40.0, correlation_time: tuple[float, ...] = ()) -> TrackData:
    """Two sensors, steps of 0.1 ms to 2 s, coincident stamps, gaps, noise scales at both clamps.

    With two correlation times, each sensor has an error state, and one measurement in ten is white.
    """
    rng = np.random.default_rng(seed)
    dt = np.exp(rng.uniform(np.log(1e-4), np.log(0.2), n))
    dt[rng.choice(np.arange(1, n), n // 6, replace=False)] = 0.0
    dt[[n // 3, 2 * n // 3]] = [2.0, 1.6]
    t = np.cumsum(dt)
    truth = np.stack([600 + 200 * np.sin(0.5 * t), 300 + 100 * np.cos(0.3 * t) - 100], axis=1)
    slow = rng.random(n) < 0.3
    base = np.where(slow, 4.0, 16.0)
    r = (base * rng.choice([0.5, 5.0], n))[:, None] * np.array([1.0, 0.7])
    z = truth + rng.normal(size=(n, 2)) * np.sqrt(r)
    density = q * rng.uniform(0.5, 1.5, n)
    prior = coloured_prior(PRIOR_MEAN, PRIOR_COV, len(correlation_time))
    error = np.where(rng.random(n) < 0.1, -1, np.where(slow, 0, 1)) if correlation_time else np.full(n, -1)
    coloured_std = np.where(error[:, None] >= 0, rng.uniform(1.0, 6.0, (n, 2)), 0.0)
    return TrackData.from_measurements(
        Prior(0.0, *prior), measurements(t, z, r, density, coloured_std, error), correlation_time
    )


def sampled(
    seed: int = 0, seconds: float = 10.0, q: float = 100.0, correlation_time: tuple[float, ...] = ()
) -> tuple[TrackData, np.ndarray]:
    """A track drawn from the model itself, 20 and 100 Hz, and its true states (K, 2, 3 + B)."""
    rng = np.random.default_rng(seed)
    slow, fast = np.arange(0.05, seconds, 0.05), np.arange(0.003, seconds, 0.01)
    t = np.concatenate([slow, fast])
    order = np.argsort(t, kind="stable")
    t, sensor = t[order], np.repeat([0, 1], [len(slow), len(fast)])[order]
    n = len(t)
    r = rng.choice([4.5, 9.0, 45.0], (n, 1)) * np.ones(2)
    prior = coloured_prior(PRIOR_MEAN, PRIOR_COV, len(correlation_time))
    size = prior[0].shape[1]
    x = prior[0] + rng.normal(size=(2, size)) * np.sqrt(np.diag(prior[1][0]))
    error = sensor if correlation_time else np.full(n, -1)
    coloured_std = np.where(error >= 0, np.where(sensor == 0, 3.0, 5.0), 0.0)[:, None] * np.ones(2)
    states, z = [x], []
    for row, step in enumerate(np.diff(t, prepend=0.0)):
        unit = np.concatenate([[step**2.5, step**1.5, step**0.5], np.ones(len(correlation_time))])
        scaled_noise = joint_noise(step, q, correlation_time) / np.outer(unit, unit)
        x = x @ joint_transition(step, correlation_time).T
        x = x + rng.normal(size=(2, size)) @ (np.linalg.cholesky(scaled_noise) * unit[:, None]).T
        states.append(x)
        z.append(x[:, 0] + (coloured_std[row] * x[:, 3 + error[row]] if correlation_time else 0.0))
    z = np.array(z) + rng.normal(size=(n, 2)) * np.sqrt(r)
    track = TrackData.from_measurements(
        Prior(0.0, *prior), measurements(t, z, r, np.full(n, q), coloured_std, error), correlation_time
    )
    return track, np.array(states)


def dense(track: TrackData, extra_t: float | None = None, extra_q: float = 1.0):
    """Condition the joint normal of all states on all measurements, by dense algebra.

    Returns means (K, 2, n) and the joint covariances (2, n K, n K). With `extra_t`, a state without a
    measurement is put in at that time, as the last of the K.
    """
    t, q, n = list(track.t), list(track.jerk), track.size
    order = list(range(len(t)))
    if extra_t is not None:
        place = int(np.searchsorted(t, extra_t))
        t.insert(place, extra_t)
        q.insert(place, q[place] if place < len(q) else extra_q)
        order = [i for i in range(len(t)) if i != place] + [place]
    K = len(t)
    means, covs = [], []
    for axis in range(2):
        m = np.zeros((K, n))
        S = np.zeros((K, n, K, n))
        m[0], S[0, :, 0] = track.prior_mean[axis], track.prior_cov[axis]
        for k in range(1, K):
            step = joint_transition(t[k] - t[k - 1], track.correlation_time)
            m[k] = step @ m[k - 1]
            for j in range(k):
                S[k, :, j] = step @ S[k - 1, :, j]
                S[j, :, k] = S[k, :, j].T
            S[k, :, k] = step @ S[k - 1, :, k - 1] @ step.T + joint_noise(
                t[k] - t[k - 1], q[k], track.correlation_time
            )
        m, S = m[order], S[order][:, :, order]
        S = S.reshape(n * K, n * K)
        H = np.zeros((len(track.z), n * K))
        H[:, : n * len(track)] = rows_of_measurements(track, axis)
        innovation = H @ S @ H.T + np.diag(track.r[:, axis])
        K_gain = np.linalg.solve(innovation, H @ S).T
        means.append((m.ravel() + K_gain @ (track.z[:, axis] - H @ m.ravel())).reshape(K, n))
        # Joseph form: the plain one loses what the prior's large covariance cancels.
        left = np.eye(n * K) - K_gain @ H
        covs.append(left @ S @ left.T + K_gain @ np.diag(track.r[:, axis]) @ K_gain.T)
    return np.stack(means, axis=1), np.stack(covs)


def blocks(joint: np.ndarray, lag: int = 0, size: int = 3) -> np.ndarray:
    """Blocks (K - lag, 2, n, n) of joint covariances (2, n K, n K), `lag` above the main diagonal."""
    K = joint.shape[1] // size
    grid = joint.reshape(2, K, size, K, size)
    return np.stack([grid[:, k, :, k + lag] for k in range(K - lag)])


def joined(pieces: Sequence[SmoothedTrack]) -> SmoothedTrack:
    """One trajectory of the pieces that a smoother gives: the last state of each begins the next."""
    return SmoothedTrack.concatenate([*(piece.select(slice(None, -1)) for piece in pieces[:-1]), pieces[-1]])


def relative(a: np.ndarray, b: np.ndarray) -> float:
    """Largest difference of covariances (..., n, n), relative to the standard deviations."""
    sigma = np.sqrt(np.einsum("...ii->...i", b))
    return float(np.max(np.abs(a - b) / (sigma[..., :, None] * sigma[..., None, :])))


def scaled(a: np.ndarray, b: np.ndarray) -> float:
    """Largest difference of means (..., n), acceleration and velocity brought to px by 0.05 s."""
    return float(np.max(np.abs(a - b) * np.concatenate([SCALE, np.ones(a.shape[-1] - 3)])))


@pytest.fixture(name="harsh")
def _harsh() -> Callable[..., TrackData]:
    return harsh


@pytest.fixture(name="sampled")
def _sampled() -> Callable[..., tuple[TrackData, np.ndarray]]:
    return sampled


@pytest.fixture(name="dense")
def _dense():
    return dense


@pytest.fixture(name="blocks")
def _blocks():
    return blocks


@pytest.fixture(name="relative")
def _relative():
    return relative


@pytest.fixture(name="scaled")
def _scaled():
    return scaled
