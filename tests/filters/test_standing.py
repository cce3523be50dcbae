"""Standing tracks: two models compared, and the zero-velocity update."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from jeat_graph.filters.standing import (
    moving_evidence,
    stand_still,
    still_evidence,
    update_odds,
    update_rest_point,
    zero_update,
)


def is_close_covariance(a, b, tolerance=1e-8):
    """Compare in units of the standard deviations, so that every entry counts alike."""
    scale = np.sqrt(np.diag(b))
    return np.abs((a - b) / np.outer(scale, scale)).max() < tolerance


@pytest.mark.parametrize("component", [1, 2])
def test_a_pseudo_measurement_of_zero_is_a_kalman_update(dense, component):
    rng = np.random.default_rng(1)
    mean, cov = dense.random_tracks(rng, 30)
    H = np.kron(np.eye(3)[component], np.eye(2))
    for m, P in zip(mean, cov, strict=True):
        std = rng.uniform(0.1, 30.0)
        x, full, _ = dense.update(
            dense.state_vector(m), dense.full_covariance(P), H, np.zeros(2), std**2 * np.eye(2)
        )
        for axis in range(2):
            zero_update(m[axis], P[axis], component, std)
        assert np.allclose(dense.state_vector(m), x, rtol=1e-8, atol=1e-8)
        assert is_close_covariance(dense.full_covariance(P), full)


def test_standing_still_measures_velocity_acceleration_and_growth_as_zero(dense):
    rng = np.random.default_rng(2)
    mean, cov = dense.random_tracks(rng, 20)
    rate_std, size = 0.05, 40.0
    H = np.hstack([np.zeros((4, 2)), np.eye(4)])
    for m, P in zip(mean, cov, strict=True):
        root = rng.normal(size=(2, 2, 2))
        size_mean, size_cov = rng.normal(size=(2, 2)), root @ np.swapaxes(root, 1, 2) + 0.1 * np.eye(2)
        sizes = size_mean.copy(), size_cov.copy()
        x, full, _ = dense.update(
            dense.state_vector(m),
            dense.full_covariance(P),
            H,
            np.zeros(4),
            (rate_std * size) ** 2 * np.eye(4),
        )
        stand_still(m, P, size_mean, size_cov, rate_std, size)
        assert np.allclose(dense.state_vector(m), x, rtol=1e-7, atol=1e-7)
        assert is_close_covariance(dense.full_covariance(P), full, 1e-7)
        for side in range(2):
            s, V, _ = dense.update(
                sizes[0][side], sizes[1][side], np.array([[0.0, 1.0]]), np.zeros(1), np.array([[rate_std**2]])
            )
            assert np.allclose(size_mean[side], s)
            assert np.allclose(size_cov[side], V)


def test_a_zero_of_what_is_hardly_known_leaves_the_variance_of_the_measurement():
    m, P = np.array([3.0, 5.0]), np.array([[1e30, 5e29], [5e29, 1e30]])
    zero_update(m, P, 1, 0.5)
    assert P[1, 1] == pytest.approx(0.25)
    assert np.linalg.det(P) > 0.0


def test_no_covariance_is_lost_to_rounding_where_hardly_anything_was_known():
    m, P = np.zeros(3), np.diag([1e12, 1e15, 1e9])
    P[0, 1] = P[1, 0] = 0.5 * np.sqrt(1e27)
    P[1, 2] = P[2, 1] = 0.5 * np.sqrt(1e24)
    expected = P[1] * 1e-4 / (1e15 + 1e-4)  # P[1] - P[1, 1] / S · P[1] would be a difference of large numbers
    zero_update(m, P, 1, 1e-2)
    assert P[1] == pytest.approx(expected, rel=1e-12, abs=0.0)
    assert np.array_equal(P, P.T)


def test_evidence_of_each_model_is_its_gaussian_density():
    rng = np.random.default_rng(2)
    anchor, anchor_var = rng.normal(size=2), rng.uniform(0.1, 3.0, 2)
    mean, cov = rng.normal(size=(2, 3)), np.tile(np.diag([2.0, 5.0, 9.0]), (2, 1, 1))
    z, R = rng.normal(size=2), rng.uniform(0.5, 4.0, 2)
    still = multivariate_normal.logpdf(z, anchor, np.diag(anchor_var + R))
    moving = multivariate_normal.logpdf(z, mean[:, 0], np.diag(cov[:, 0, 0] + R))
    assert still_evidence(anchor, anchor_var, z, R) == pytest.approx(still)
    assert moving_evidence(mean, cov, z, R) == pytest.approx(moving)


def test_the_point_of_rest_is_the_weighted_mean_of_what_was_measured():
    rng = np.random.default_rng(3)
    z, R = rng.normal(size=(20, 2)) * 4.0, rng.uniform(0.5, 9.0, (20, 2))
    anchor, var = z[0].copy(), R[0].copy()
    for k in range(1, 20):
        update_rest_point(anchor, var, z[k], R[k])
    assert np.allclose(anchor, (z / R).sum(axis=0) / (1.0 / R).sum(axis=0))
    assert np.allclose(var, 1.0 / (1.0 / R).sum(axis=0))


@given(
    odds=st.floats(-30, 30),
    still=st.floats(-1e4, 1e4),
    moving=st.floats(-1e4, 1e4),
    memory=st.floats(0, 1),
)
def test_odds_add_the_new_evidence_to_what_is_remembered(odds, still, moving, memory):
    after = update_odds(odds, still, moving, memory)
    assert after == pytest.approx(np.clip(memory * odds + still - moving, -30.0, 30.0), abs=1e-9)


def test_a_point_at_rest_gains_odds_and_one_that_moves_loses_them():
    rng = np.random.default_rng(4)
    R = np.array([1.0, 1.0])
    odds = {}
    for speed in (0.0, 40.0):
        anchor, var, log_odds = np.zeros(2), R.copy(), 0.0
        mean, cov = np.zeros((2, 3)), np.tile(np.diag([9.0, 50.0**2, 10.0]), (2, 1, 1))
        for k in range(1, 30):
            mean[0, 0] = speed * 0.05 * k
            z = np.array([speed * 0.05 * k, 0.0]) + rng.normal(size=2)
            log_odds = update_odds(
                log_odds, still_evidence(anchor, var, z, R), moving_evidence(mean, cov, z, R), 0.95
            )
            update_rest_point(anchor, var, z, R)
        odds[speed] = log_odds
    assert odds[0.0] > 5.0
    assert odds[40.0] < -5.0
