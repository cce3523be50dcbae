"""Tracks whose truth is known, and an exact solution that shares no code with the smoothers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from jeat_graph.smoothers.track_data import TrackData

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
PRIOR_MEAN = np.array([[600.0, 10.0, 0.0], [300.0, -5.0, 0.0]])


def harsh(seed: int = 0, n: int = 60, q: float = 40.0) -> TrackData:
    """Two sensors, steps of 0.1 ms to 2 s, coincident stamps, gaps, noise scales at both clamps."""
    rng = np.random.default_rng(seed)
    dt = np.exp(rng.uniform(np.log(1e-4), np.log(0.2), n))
    dt[rng.choice(np.arange(1, n), n // 6, replace=False)] = 0.0
    dt[[n // 3, 2 * n // 3]] = [2.0, 1.6]
    t = np.cumsum(dt)
    truth = np.stack([600 + 200 * np.sin(0.5 * t), 300 + 100 * np.cos(0.3 * t) - 100], axis=1)
    base = np.where(rng.random(n) < 0.3, 4.0, 16.0)
    r = (base * rng.choice([0.5, 5.0], n))[:, None] * np.array([1.0, 0.7])
    z = truth + rng.normal(size=(n, 2)) * np.sqrt(r)
    return TrackData.from_measurements(0.0, PRIOR_MEAN, PRIOR_COV, t, z, r, q * rng.uniform(0.5, 1.5, n))


def sampled(seed: int = 0, seconds: float = 10.0, q: float = 100.0) -> tuple[TrackData, np.ndarray]:
    """A track drawn from the model itself, 20 and 100 Hz, and its true states (K, 2, 3)."""
    rng = np.random.default_rng(seed)
    t = np.sort(np.concatenate([np.arange(0.05, seconds, 0.05), np.arange(0.003, seconds, 0.01)]))
    n = len(t)
    r = rng.choice([4.5, 9.0, 45.0], (n, 1)) * np.ones(2)
    x = PRIOR_MEAN + rng.normal(size=(2, 3)) * np.sqrt(np.diag(PRIOR_COV[0]))
    states, z = [x], []
    for step in np.diff(t, prepend=0.0):
        unit = np.array([step**2.5, step**1.5, step**0.5])
        root = np.linalg.cholesky(noise(step, 1.0) / np.outer(unit, unit)) * unit[:, None] * q
        x = x @ transition(step).T + rng.normal(size=(2, 3)) @ root.T
        states.append(x)
        z.append(x[:, 0])
    z = np.array(z) + rng.normal(size=(n, 2)) * np.sqrt(r)
    return TrackData.from_measurements(0.0, PRIOR_MEAN, PRIOR_COV, t, z, r, np.full(n, q)), np.array(states)


def dense(track: TrackData, extra_t: float | None = None, extra_q: float = 1.0):
    """Condition the joint normal of all states on all measurements, by dense algebra.

    Returns means (K, 2, 3) and the joint covariances (2, 3K, 3K). With `extra_t`, a state without a
    measurement is put in at that time, as the last of the K.
    """
    t, q = list(track.t), list(track.q)
    order = list(range(len(t)))
    if extra_t is not None:
        place = int(np.searchsorted(t, extra_t))
        t.insert(place, extra_t)
        q.insert(place, q[place] if place < len(q) else extra_q)
        order = [i for i in range(len(t)) if i != place] + [place]
    K = len(t)
    means, covs = [], []
    for axis in range(2):
        m = np.zeros((K, 3))
        S = np.zeros((K, 3, K, 3))
        m[0], S[0, :, 0] = track.prior_mean[axis], track.prior_cov[axis]
        for k in range(1, K):
            step = transition(t[k] - t[k - 1])
            m[k] = step @ m[k - 1]
            for j in range(k):
                S[k, :, j] = step @ S[k - 1, :, j]
                S[j, :, k] = S[k, :, j].T
            S[k, :, k] = step @ S[k - 1, :, k - 1] @ step.T + noise(t[k] - t[k - 1], q[k])
        m, S = m[order], S[order][:, :, order]
        S = S.reshape(3 * K, 3 * K)
        H = np.zeros((len(track.z), 3 * K))
        H[np.arange(len(track.z)), 3 * track.key] = 1.0
        innovation = H @ S @ H.T + np.diag(track.r[:, axis])
        K_gain = np.linalg.solve(innovation, H @ S).T
        means.append((m.ravel() + K_gain @ (track.z[:, axis] - H @ m.ravel())).reshape(K, 3))
        # Joseph form: the plain one loses what the prior's large covariance cancels.
        left = np.eye(3 * K) - K_gain @ H
        covs.append(left @ S @ left.T + K_gain @ np.diag(track.r[:, axis]) @ K_gain.T)
    return np.stack(means, axis=1), np.stack(covs)


def blocks(joint: np.ndarray, lag: int = 0) -> np.ndarray:
    """Blocks (K - lag, 2, 3, 3) of joint covariances (2, 3K, 3K) on the diagonal `lag` above the main one."""
    K = joint.shape[1] // 3
    grid = joint.reshape(2, K, 3, K, 3)
    return np.stack([grid[:, k, :, k + lag] for k in range(K - lag)])


def relative(a: np.ndarray, b: np.ndarray) -> float:
    """Largest difference of covariances (..., 3, 3), relative to the standard deviations."""
    sigma = np.sqrt(np.einsum("...ii->...i", b))
    return float(np.max(np.abs(a - b) / (sigma[..., :, None] * sigma[..., None, :])))


def scaled(a: np.ndarray, b: np.ndarray) -> float:
    """Largest difference of means (..., 3), acceleration and velocity brought to px by 0.05 s."""
    return float(np.max(np.abs(a - b) * SCALE))


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
