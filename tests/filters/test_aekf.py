"""The filter of all tracks at once equals a dense textbook Kalman filter of each."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm

from jeat_graph.filters.coloured_noise import update_centre
from jeat_graph.filters.kalman import log_gaussian, predict, predict_size, update_block

SMALLEST_NORMAL = np.finfo(np.float64).tiny


def update_white(m, P, z, R):
    """Update a track whose errors have no memory."""
    return update_centre(m, P, z, R, np.zeros(2), -1)


def smallest_eigenvalue(cov):
    """Smallest eigenvalue of covariances (…, D, D) as correlations.

    In px and s the variances lie up to twenty orders apart, and rounding alone may turn the sign of the
    smallest eigenvalue; correlations are free of units, and theirs are right to some 1e-15.
    """
    spread = np.sqrt(np.diagonal(cov, axis1=-2, axis2=-1))
    return np.linalg.eigvalsh(cov / (spread[..., :, None] * spread[..., None, :])).min()


def is_close_covariance(a, b, tolerance=1e-9):
    """Compare in units of the standard deviations, so that every entry counts alike."""
    scale = np.sqrt(np.diag(b))
    return np.abs((a - b) / np.outer(scale, scale)).max() < tolerance


@pytest.mark.parametrize("dt", [0.0, 1e-4, 0.01, 0.05, 1.3])
def test_predict_equals_the_dense_filter(dense, dt):
    rng = np.random.default_rng(1)
    mean, cov = dense.random_tracks(rng, 40)
    jerk = rng.uniform(1.0, 300.0, 40)
    expected = [
        dense.predict(dense.state_vector(m), dense.full_covariance(P), dt, q)
        for m, P, q in zip(mean, cov, jerk, strict=True)
    ]
    predict(mean, cov, jerk, dt)
    for m, P, (x, full) in zip(mean, cov, expected, strict=True):
        assert np.allclose(dense.state_vector(m), x, rtol=1e-12)
        assert is_close_covariance(dense.full_covariance(P), full)


def test_update_and_its_nis_equal_the_dense_filter(dense):
    rng = np.random.default_rng(2)
    mean, cov = dense.random_tracks(rng, 60)
    for m, P in zip(mean, cov, strict=True):
        z, R = m[:, 0] + rng.normal(size=2) * 5.0, rng.uniform(0.1, 50.0, 2)
        x, full, nis = dense.update(
            dense.state_vector(m), dense.full_covariance(P), dense.position(), z, np.diag(R)
        )
        assert update_white(m, P, z, R) == pytest.approx(nis, rel=1e-10)
        assert np.allclose(dense.state_vector(m), x, rtol=1e-9, atol=1e-9)
        assert is_close_covariance(dense.full_covariance(P), full)


def test_two_updates_in_turn_are_one_stacked_update(dense):
    rng = np.random.default_rng(3)
    mean, cov = dense.random_tracks(rng, 30)
    for m, P in zip(mean, cov, strict=True):
        z = m[:, 0] + rng.normal(size=(2, 2)) * 4.0
        R = rng.uniform(0.5, 20.0, (2, 2))
        stacked = np.vstack([dense.position(), dense.position()])
        x, full, _ = dense.update(
            dense.state_vector(m), dense.full_covariance(P), stacked, z.reshape(-1), np.diag(R.reshape(-1))
        )
        update_white(m, P, z[0], R[0])
        update_white(m, P, z[1], R[1])
        assert np.allclose(dense.state_vector(m), x, rtol=1e-8, atol=1e-8)
        assert is_close_covariance(dense.full_covariance(P), full, 1e-8)


@given(a=st.floats(0.0, 3.0), b=st.floats(0.0, 3.0), seed=st.integers(0, 10**6))
@settings(max_examples=50, deadline=None)
def test_predicting_twice_is_predicting_once(dense, a, b, seed):
    rng = np.random.default_rng(seed)
    mean, cov = dense.random_tracks(rng, 3)
    once_mean, once_cov = mean.copy(), cov.copy()
    jerk = rng.uniform(0.0, 200.0, 3)
    predict(mean, cov, jerk, a)
    predict(mean, cov, jerk, b)
    predict(once_mean, once_cov, jerk, a + b)
    assert np.allclose(mean, once_mean, rtol=1e-9, atol=1e-9)
    for twice, once in zip(cov.reshape(-1, 3, 3), once_cov.reshape(-1, 3, 3), strict=True):
        assert is_close_covariance(twice, once)


def test_size_filter_equals_a_dense_one():
    rng = np.random.default_rng(4)
    root = rng.normal(size=(20, 2, 2, 2))
    cov = root @ np.swapaxes(root, -1, -2) + 0.01 * np.eye(2)
    mean = rng.normal(size=(20, 2, 2))
    dt, density, R = 0.07, rng.uniform(0.0, 2.0, 20), 0.01
    F = np.array([[1.0, dt], [0.0, 1.0]])
    Q = density[:, None, None] ** 2 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    before = mean.copy(), cov.copy()
    predict_size(mean, cov, density, dt)
    for i in range(20):
        for side in range(2):
            x, P = F @ before[0][i, side], F @ before[1][i, side] @ F.T + Q[i]
            assert np.allclose(mean[i, side], x)
            assert np.allclose(cov[i, side], P)
            z = x[0] + rng.normal() * 0.1
            K = P[:, 0] / (P[0, 0] + R)
            left = np.eye(2) - np.outer(K, [1.0, 0.0])
            nis = update_block(mean[i, side], cov[i, side], z, R)
            assert nis == pytest.approx((z - x[0]) ** 2 / (P[0, 0] + R))
            assert np.allclose(mean[i, side], x + K * (z - x[0]))
            assert np.allclose(cov[i, side], left @ P @ left.T + R * np.outer(K, K), atol=1e-12)


def test_covariances_stay_positive_definite_and_normal_over_thousands_of_steps(dense):
    rng = np.random.default_rng(5)
    mean, cov = dense.random_tracks(rng, 8)
    jerk = np.array([0.0, 0.01, 1.0, 10.0, 50.0, 200.0, 1000.0, 5000.0])
    for k in range(4000):
        predict(mean, cov, jerk, float(np.exp(rng.uniform(np.log(1e-4), np.log(0.5)))))
        for i in range(8):
            if rng.random() < 0.7:
                update_white(mean[i], cov[i], rng.normal(size=2) * 3.0, rng.uniform(0.2, 100.0, 2))
        if k % 100 == 0:
            assert np.array_equal(cov, np.swapaxes(cov, -1, -2))
            assert smallest_eigenvalue(cov) > 1e-12
    for array in (mean, cov):
        size = np.abs(array[array != 0.0])
        assert np.isfinite(array).all()
        assert (size >= SMALLEST_NORMAL).all()


@pytest.mark.parametrize("gap", [10.0, 1e3, 1e6])
def test_after_a_gap_of_any_length_a_measurement_is_all_that_is_known_of_the_position(gap):
    mean = np.zeros((1, 2, 3))
    cov = np.tile(np.diag([9.0, 150.0**2, 100.0**2]), (1, 2, 1, 1))
    for _ in range(4):
        predict(mean, cov, np.array([200.0]), gap)
        update_white(mean[0], cov[0], np.array([5.0, 5.0]), np.array([9.0, 9.0]))
        assert np.allclose(mean[0, :, 0], 5.0, atol=1e-4)
        assert np.allclose(cov[0, :, 0, 0], 9.0, rtol=1e-4)
        assert smallest_eigenvalue(cov) > 1e-12


@given(y=st.floats(-1e3, 1e3), S=st.floats(1e-6, 1e6))
def test_log_gaussian_is_the_normal_density(y, S):
    assert log_gaussian(y, S) == pytest.approx(norm.logpdf(y, scale=np.sqrt(S)), rel=1e-9, abs=1e-9)
