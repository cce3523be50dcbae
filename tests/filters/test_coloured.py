"""Errors with memory: the augmented filter against dense algebra, and its covariance against the truth."""

import numpy as np
import pytest
from scipy.linalg import block_diag

from jeat_graph.filters.coloured_noise import expected, predict_errors, update_centre, update_with_error
from jeat_graph.filters.kalman import predict, update_block
from jeat_graph.filters.motion import process_noise, transition

MEMORY = np.array([0.15, 0.4])


def random_tracks(rng, count, errors):
    """Means (N, 2, 3 + B) and covariances of tracks in px and s."""
    D = 3 + errors
    scale = np.array([5.0, 40.0, 90.0] + [1.0] * errors)
    mean = rng.normal(size=(count, 2, D)) * scale
    root = rng.normal(size=(count, 2, D, D + 2)) * scale[:, None]
    return mean, root @ root.transpose(0, 1, 3, 2) / (D + 2)


def dense_step(dt, q):
    """Transition and process noise of one axis of [p, v, a, e_1, e_2]."""
    phi = np.exp(-dt / MEMORY)
    return block_diag(transition(dt), np.diag(phi)), block_diag(process_noise(dt, q), np.diag(1 - phi**2))


def is_close(a, b, tolerance=1e-10):
    """Compare covariances in units of the standard deviations."""
    scale = np.sqrt(np.diagonal(b, axis1=-2, axis2=-1))
    return np.abs((a - b) / (scale[..., :, None] * scale[..., None, :])).max() < tolerance


@pytest.mark.parametrize("dt", [0.0, 1e-4, 0.01, 0.3, 2.0])
def test_prediction_equals_the_dense_form(dt):
    mean, cov = random_tracks(np.random.default_rng(0), 20, 2)
    F, Q = dense_step(dt, 30.0)
    x, P = mean @ F.T, F @ cov @ F.T + Q
    predict(mean, cov, np.full(20, 30.0), dt)
    predict_errors(mean, cov, MEMORY, dt)
    assert np.allclose(mean, x, rtol=1e-12, atol=1e-12)
    assert is_close(cov, P)


@pytest.mark.parametrize("error", [-1, 0, 1])
def test_update_and_its_nis_equal_the_dense_form(error):
    rng = np.random.default_rng(1)
    mean, cov = random_tracks(rng, 30, 2)
    H = np.zeros((2, 5))
    H[:, 0] = 1.0
    for m, P in zip(mean, cov, strict=True):
        z, R, lever = m[:, 0] + rng.normal(size=2) * 4.0, rng.uniform(0.1, 9.0, 2), rng.uniform(0.5, 3.0, 2)
        if error >= 0:
            H[:, 3 + error] = lever
        nis, wanted = 0.0, []
        for axis in range(2):
            h, x, C = H[axis], m[axis].copy(), P[axis].copy()
            S = h @ C @ h + R[axis]
            K = C @ h / S
            nis += (z[axis] - h @ x) ** 2 / S
            A = np.eye(5) - np.outer(K, h)
            wanted.append((x + K * (z[axis] - h @ x), A @ C @ A.T + R[axis] * np.outer(K, K)))
            assert expected(x, C, lever[axis], error) == pytest.approx((h @ x, h @ C @ h))
        assert update_centre(m, P, z, R, lever, error) == pytest.approx(nis, rel=1e-9)
        for axis in range(2):
            assert np.allclose(m[axis], wanted[axis][0], rtol=1e-9, atol=1e-9)
            assert is_close(P[axis], wanted[axis][1], 1e-8)


def test_a_sensor_without_memory_updates_as_in_the_paper_s_state():
    rng = np.random.default_rng(2)
    mean, cov = random_tracks(rng, 10, 0)
    wide, wide_cov = np.zeros((10, 2, 5)), np.tile(np.eye(5), (10, 2, 1, 1))
    wide[:, :, :3], wide_cov[:, :, :3, :3] = mean, cov
    z, R = rng.normal(size=2), np.array([2.0, 3.0])
    for i in range(10):
        nis = update_centre(mean[i], cov[i], z, R, np.zeros(2), -1)
        assert update_centre(wide[i], wide_cov[i], z, R, np.zeros(2), -1) == pytest.approx(nis, rel=1e-12)
    assert np.allclose(wide[:, :, :3], mean, rtol=1e-12)
    assert is_close(wide_cov[:, :, :3, :3], cov)
    assert np.array_equal(wide_cov[:, :, 3:, 3:], np.tile(np.eye(2), (10, 2, 1, 1)))


@pytest.mark.parametrize("update", [update_with_error, update_with_error.py_func])
def test_a_block_without_error_states_is_updated_as_the_paper_s(update):
    """With nothing read beyond its end, which only the plain function would notice."""
    mean, cov = random_tracks(np.random.default_rng(5), 1, 0)
    m, P = mean[0, 1].copy(), cov[0, 1].copy()
    nis = update(m, P, 3.0, 2.0, 1.5, -1, np.empty(3))
    assert nis == pytest.approx(update_block(mean[0, 1], cov[0, 1], 3.0, 2.0), rel=1e-12)
    assert np.allclose(m, mean[0, 1], rtol=1e-12)
    assert is_close(P, cov[0, 1])


def test_after_a_long_gap_no_variance_is_lost_to_rounding():
    m, P = np.zeros(4), np.diag([1e15, 1e12, 1e9, 1.0])
    P[0, 1] = P[1, 0] = 0.9 * np.sqrt(1e27)
    update_with_error(m, P, 7.0, 4.0, 1.5, 0, np.empty(4))
    # What the position is off by now: the white noise and the lever times the error, as at a birth.
    assert P[0, 0] == pytest.approx(4.0 + 1.5**2, rel=1e-6)
    assert P[0, 3] == pytest.approx(-1.5, rel=1e-6)


def test_nothing_sinks_into_subnormals_while_a_sensor_is_silent():
    mean, cov = random_tracks(np.random.default_rng(3), 4, 2)
    for _ in range(20_000):
        predict_errors(mean, cov, MEMORY, 0.01)
    small = np.abs(cov[cov != 0.0])
    assert small.min() > np.finfo(np.float64).tiny
    assert np.allclose(cov[:, :, [3, 4], [3, 4]], 1.0)


def filtered_errors(rng, coloured):
    """Squared errors of positions over their variances, of a filter that knows the memory or does not."""
    dt, steps, q, white, lever = 0.02, 150, 60.0, 1.5, 2.0
    F, Q = dense_step(dt, q)
    root = np.linalg.cholesky(Q)
    out = []
    for _ in range(40):
        x = rng.normal(size=(2, 5)) * [0.0, 50.0, 40.0, 1.0, 1.0]
        B = 2 if coloured else 0
        mean = np.zeros((1, 2, 3 + B))
        cov = np.tile(np.diag([1e4, 50.0**2, 40.0**2] + [1.0] * B), (1, 2, 1, 1))
        for k in range(steps):
            if k:
                x = x @ F.T + rng.normal(size=(2, 5)) @ root.T
                predict(mean, cov, np.array([q]), dt)
                if coloured:
                    predict_errors(mean, cov, MEMORY, dt)
            sensor = k % 2
            z = x[:, 0] + lever * x[:, 3 + sensor] + np.sqrt(white) * rng.normal(size=2)
            if coloured:
                update_centre(mean[0], cov[0], z, np.full(2, white), np.full(2, lever), sensor)
            else:
                update_centre(mean[0], cov[0], z, np.full(2, white + lever**2), np.zeros(2), -1)
        error = mean[0, :, :3] - x[:, :3]
        out.append([error[a] @ np.linalg.solve(cov[0, a, :3, :3], error[a]) for a in range(2)])
    return np.array(out)


def test_the_covariance_tells_the_truth_only_if_the_memory_is_known():
    knows = filtered_errors(np.random.default_rng(4), True)
    takes_it_for_white = filtered_errors(np.random.default_rng(4), False)
    # 80 values of χ² with 3 degrees of freedom: their mean is 3 within ±1.96 √(2·3 / 80) = ±.54.
    assert abs(knows.mean() - 3.0) < 0.54
    assert takes_it_for_white.mean() > 5.0
