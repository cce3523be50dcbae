"""The whole-track GTSAM solution is exact."""

import numpy as np
import pytest

from jeat_graph.smoothers.gtsam.full import smooth_full
from jeat_graph.smoothers.rts import smooth_rts

#: White errors, and two sensors with coloured errors (s).
COLOURS = [(), (0.3, 0.08)]


@pytest.mark.parametrize("correlation_time", COLOURS)
@pytest.mark.parametrize("seed", [0, 1, 2, 3, 34, 53])
def test_equals_the_dense_solution_on_harsh_timing(
    harsh, dense, blocks, scaled, relative, seed, correlation_time
):
    track = harsh(seed, correlation_time=correlation_time)
    smoothed = smooth_full(track)
    mean, joint = dense(track)
    assert scaled(smoothed.mean, mean) < 1e-6
    assert relative(smoothed.cov, blocks(joint, size=track.size)) < 1e-6


@pytest.mark.parametrize("correlation_time", COLOURS)
def test_equals_numpys_least_squares(sampled, scaled, correlation_time):
    track, _ = sampled(0, seconds=0.5, correlation_time=correlation_time)
    K, n, solution = len(track), track.size, []
    unit = np.concatenate([[1, 0.05, 0.0025], np.ones(n - 3)])
    for axis in range(2):
        rows, b = [], []

        def add(W, *terms, target=0.0, rows=rows, b=b):
            line = np.zeros((len(W), n * K))
            for key, A in terms:
                line[:, n * key : n * key + n] = W @ A
            rows.append(line)
            b.append(W @ np.broadcast_to(target, len(W[0])))

        P = track.prior_cov[axis]
        add(np.linalg.inv(np.linalg.cholesky(P)), (0, np.eye(n)), target=track.prior_mean[axis])
        for k in range(1, K):
            dt, q = track.t[k] - track.t[k - 1], track.jerk[k]
            F, Q = np.eye(n), np.eye(n)
            F[:3, :3] = [[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]]
            g = [[dt**5 / 20, dt**4 / 8, dt**3 / 6], [dt**4 / 8, dt**3 / 3, dt**2 / 2]]
            Q[:3, :3] = q**2 * np.array([*g, [dt**3 / 6, dt**2 / 2, dt]])
            for i, tau in enumerate(correlation_time, start=3):
                F[i, i], Q[i, i] = np.exp(-dt / tau), 1.0 - np.exp(-2.0 * dt / tau)
            add(np.linalg.inv(np.linalg.cholesky(Q)), (k - 1, -F), (k, np.eye(n)))
        for row, key in enumerate(track.key):
            H = np.eye(n)[:1]
            if track.error[row] >= 0:
                H[0, 3 + track.error[row]] = track.coloured_std[row, axis]
            add(np.array([[1 / np.sqrt(track.r[row, axis])]]), (key, H), target=track.z[row, axis])
        A = np.concatenate(rows) * np.tile(1 / unit, K)
        y = np.linalg.lstsq(A, np.concatenate(b), rcond=None)[0].reshape(K, n)
        solution.append(y / unit)
    assert scaled(smooth_full(track).mean, np.stack(solution, axis=1)) < 1e-6


@pytest.mark.parametrize("correlation_time", COLOURS)
@pytest.mark.parametrize("seed", range(2))
def test_equals_rts_over_a_long_track(sampled, scaled, relative, seed, correlation_time):
    track, _ = sampled(seed, seconds=8.0, q=30.0, correlation_time=correlation_time)
    full, rts = smooth_full(track), smooth_rts(track)
    assert scaled(full.mean, rts.mean) < 1e-6
    assert relative(full.cov, rts.cov) < 1e-6
    assert np.allclose(full.cross(), rts.cross(), rtol=1e-5, atol=1e-6)
