"""The smoothed process against a dense solve of the same Gaussian."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.corridor.shared_slowness import by_lane, pooled, shared_slowness, smoothed


def dense(t, value, variance, sigma, time_s):
    """Posterior mean (N,) by the covariance of all times."""
    prior = sigma**2 * np.exp(-np.abs(t[:, None] - t[None]) / time_s)
    seen = np.isfinite(variance)
    gain = prior[:, seen] @ np.linalg.inv(prior[np.ix_(seen, seen)] + np.diag(variance[seen]))
    return gain @ value[seen]


@pytest.mark.parametrize("seed", range(3))
def test_it_is_the_posterior_mean(seed):
    rng = np.random.default_rng(seed)
    t = np.sort(rng.uniform(0.0, 300.0, 40))
    variance = np.where(rng.random(40) < 0.2, np.inf, rng.uniform(0.001, 0.02, 40))
    value = rng.normal(0.0, 0.1, 40)
    np.testing.assert_allclose(
        smoothed(t, value, variance, 0.1, 60.0), dense(t, value, variance, 0.1, 60.0), rtol=0, atol=1e-10
    )


def test_noise_alone_is_no_process():
    rng = np.random.default_rng(5)
    t = np.arange(400.0)
    found = shared_slowness(t, rng.normal(0.0, 0.05, 400), np.full(400, 0.05**2))
    assert np.abs(found.mean).max() < 0.02


def test_a_queue_shows_and_lanes_have_their_own():
    rng = np.random.default_rng(6)
    t, lane = np.arange(600.0), rng.integers(0, 2, 600)
    truth = np.where((t > 200.0) & (t < 400.0), 0.4, 0.0) + np.where(lane == 1, 0.1, 0.0)
    found, _ = by_lane(t, lane, truth + rng.normal(0.0, 0.03, 600), np.full(600, 0.03**2))
    assert np.sqrt(np.mean((found - truth) ** 2)) < 0.03


def test_observations_of_a_row_are_pooled():
    value, variance = pooled(
        np.array([0, 0, 2]),
        np.array([1.0, 3.0, 5.0]),
        np.array([1.0, 1.0, 2.0]),
        np.array([0.5, 1.0, 1.0]),
        3,
    )
    assert value.tolist() == pytest.approx([7.0 / 3.0, 0.0, 5.0])
    assert variance.tolist() == pytest.approx([2.0 / 3.0, np.inf, 2.0])
