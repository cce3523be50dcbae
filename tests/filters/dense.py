"""A textbook Kalman filter with full matrices: the oracle of the filters' tests. It shares no code."""

import numpy as np


def transition(dt):
    """F of the state [x, y, vx, vy, ax, ay]."""
    block = np.array([[1.0, dt, dt**2 / 2], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
    return np.kron(block, np.eye(2))


def process_noise(dt, jerk):
    """Q of the state [x, y, vx, vy, ax, ay]."""
    block = np.array(
        [
            [dt**5 / 20, dt**4 / 8, dt**3 / 6],
            [dt**4 / 8, dt**3 / 3, dt**2 / 2],
            [dt**3 / 6, dt**2 / 2, dt],
        ]
    )
    return np.kron(jerk**2 * block, np.eye(2))


def predict(x, P, dt, jerk):
    F = transition(dt)
    return F @ x, F @ P @ F.T + process_noise(dt, jerk)


def update(x, P, H, z, R):
    """Joseph update; returns state, covariance and the normalised innovation squared."""
    y = z - H @ x
    S = H @ P @ H.T + R
    K = P @ H.T @ np.linalg.inv(S)
    left = np.eye(len(x)) - K @ H
    return x + K @ y, left @ P @ left.T + K @ R @ K.T, float(y @ np.linalg.inv(S) @ y)


def position(dims=6):
    """H that picks the box centre."""
    return np.hstack([np.eye(2), np.zeros((2, dims - 2))])


def state_vector(mean):
    """(2, 3) per axis [p, v, a] to (6,) [x, y, vx, vy, ax, ay]."""
    return mean.T.reshape(-1)


def full_covariance(cov):
    """(2, 3, 3) per axis to (6, 6)."""
    out = np.zeros((6, 6))
    for axis in range(2):
        out[axis::2, axis::2] = cov[axis]
    return out


def random_tracks(rng, n):
    """Means (n, 2, 3) and covariances (n, 2, 3, 3), positive definite, of the size of real ones."""
    mean = rng.normal(size=(n, 2, 3)) * [500.0, 200.0, 80.0]
    root = rng.normal(size=(n, 2, 3, 3)) * np.array([3.0, 60.0, 40.0])[:, None]
    cov = root @ np.swapaxes(root, -1, -2) + np.diag([0.1, 1.0, 1.0])
    return mean, 0.5 * (cov + np.swapaxes(cov, -1, -2))
