"""Tracks drawn from the white-jerk model, and the exact solution by dense least squares."""

import numpy as np

PRIOR_COV = np.diag([9.0, 50.0**2, 30.0**2])


def transition(dt):
    return np.array([[1.0, dt, dt * dt / 2], [0, 1, dt], [0, 0, 1]])


def noise(dt, jerk):
    upper = [
        [dt**5 / 20, dt**4 / 8, dt**3 / 6],
        [dt**4 / 8, dt**3 / 3, dt**2 / 2],
        [dt**3 / 6, dt**2 / 2, dt],
    ]
    return jerk**2 * np.array(upper)


def drawn(seed, keys, jerk=80.0, shortest=0.004, longest=0.05):
    """Steps F, Q (K, 3, 3), measurements z (K + 1, 2) and their information (K + 1,), 0 for some."""
    rng = np.random.default_rng(seed)
    dt = rng.uniform(shortest, longest, keys - 1)
    F, Q = np.array([transition(d) for d in dt]), np.array([noise(d, jerk) for d in dt])
    x = rng.normal(size=(2, 3)) @ np.linalg.cholesky(PRIOR_COV).T + [[600.0, 100.0, 0.0], [300.0, -50.0, 0.0]]
    path = [x]
    for k in range(keys - 1):
        x = x @ F[k].T + rng.normal(size=(2, 3)) @ np.linalg.cholesky(Q[k]).T
        path.append(x)
    information = np.where(rng.random(keys) < 0.7, rng.uniform(0.05, 1.0, keys), 0.0)
    information[0] = 0.0
    spread = 1.0 / np.sqrt(np.where(information > 0, information, 1.0))
    z = np.array(path)[:, :, 0] + spread[:, None] * rng.normal(size=(keys, 2))
    prior = np.array([[600.0, 100.0, 0.0], [300.0, -50.0, 0.0]])
    return F, Q, z, information, prior


def filtered(F, Q, z, information, prior):
    """Kalman filter: means (K + 1, 2, 3) and covariances (K + 1, 3, 3)."""
    means, covs = [], []
    m, P = prior, PRIOR_COV
    for k in range(len(z)):
        if k:
            m, P = m @ F[k - 1].T, F[k - 1] @ P @ F[k - 1].T + Q[k - 1]
        if information[k] > 0:
            S = P[0, 0] + 1.0 / information[k]
            K = P[:, 0] / S
            m, P = m + np.outer(z[k] - m[:, 0], K), P - np.outer(K, P[0])
        means.append(m)
        covs.append(P)
    return np.array(means), np.array(covs)


def dense(F, Q, z, information, prior):
    """Weighted least squares for all states at once: means (K + 1, 2, 3), covariances (K + 1, 3, 3)."""
    keys = len(z)
    rows, right = [], []
    root = np.linalg.inv(np.linalg.cholesky(PRIOR_COV))
    first = np.zeros((3, 3 * keys))
    first[:, :3] = root
    rows.append(first)
    right.append(root @ prior.T)
    for k in range(keys - 1):
        root = np.linalg.inv(np.linalg.cholesky(Q[k]))
        row = np.zeros((3, 3 * keys))
        row[:, 3 * k : 3 * k + 3], row[:, 3 * k + 3 : 3 * k + 6] = -root @ F[k], root
        rows.append(row)
        right.append(np.zeros((3, 2)))
    for k in np.flatnonzero(information):
        row = np.zeros((1, 3 * keys))
        row[0, 3 * k] = np.sqrt(information[k])
        rows.append(row)
        right.append(np.sqrt(information[k]) * z[k][None])
    A, b = np.vstack(rows), np.vstack(right)
    scale = 1.0 / np.linalg.norm(A, axis=0)
    q, r = np.linalg.qr(A * scale)
    x = scale[:, None] * np.linalg.solve(r, q.T @ b)
    inverse = scale[:, None] * np.linalg.inv(r)
    whole = inverse @ inverse.T
    covs = np.array([whole[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] for k in range(keys)])
    return x.reshape(keys, 3, 2).swapaxes(1, 2), covs


#: Differences of states are judged in these units (px, px/s, px/s²).
UNITS = np.array([1.0, 20.0, 400.0])
