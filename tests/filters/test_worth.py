"""What scores are worth: the step against a dense Newton step, and what many steps learn."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jeat_graph.filters.worth import doubt_worth, learn_worth, worth_of

ODDS = st.floats(-4.0, 4.0)


def follow(a, b, count, weight=1.0, seed=0, first=(0.0, 1.0)):
    """Learn from `count` boxes whose chance to last is that of `a` and `b`; mean and covariance."""
    rng = np.random.default_rng(seed)
    mean, cov = np.array(first), np.eye(2)
    for x in rng.normal(0.0, 1.5, count):
        lasts = bool(rng.random() < 1.0 / (1.0 + np.exp(-a - b * x)))
        learn_worth(mean, cov, x, lasts, weight)
    return mean, cov


@given(
    ODDS,
    st.booleans(),
    st.floats(1e-3, 20.0),
    st.floats(-2.0, 2.0),
    st.floats(0.5, 2.0),
    st.floats(-0.6, 0.6),
)
def test_a_step_is_that_of_newton_on_the_posterior(odds, lasts, weight, a, b, correlation):
    """Dense oracle: the posterior's precision is P⁻¹ + w q (1 − q) x xᵀ, its step P' x w (label − q)."""
    mean, cov = np.array([a, b]), np.array([[1.3, correlation], [correlation, 0.8]])
    x = np.array([1.0, odds])
    q = 1.0 / (1.0 + np.exp(-mean @ x))
    expected_cov = np.linalg.inv(np.linalg.inv(cov) + weight * q * (1.0 - q) * np.outer(x, x))
    expected = mean + expected_cov @ x * weight * (float(lasts) - q)
    learn_worth(mean, cov, odds, lasts, weight)
    np.testing.assert_allclose(cov, expected_cov, rtol=1e-8, atol=1e-10)
    assert mean[0] == pytest.approx(expected[0], rel=1e-8, abs=1e-9)
    assert mean[1] == pytest.approx(max(expected[1], 0.0), rel=1e-8, abs=1e-9)


@pytest.mark.parametrize(("a", "b"), [(-1.5, 2.0), (1.0, 0.5), (-0.5, 1.0)])
def test_what_is_true_of_a_detector_is_learnt_within_what_is_stated(a, b):
    mean, cov = follow(a, b, 3000)
    assert np.all(np.abs(mean - (a, b)) < 4.0 * np.sqrt(np.diag(cov)))
    assert np.sqrt(np.diag(cov)).max() < 0.15


def test_scores_that_mean_nothing_tell_no_track_from_another():
    mean, _ = follow(1.5, 0.0, 3000)
    worth = [worth_of(mean, odds) for odds in (-2.0, 0.0, 2.0)]
    assert max(worth) - min(worth) < 0.1
    assert min(worth) > 0.7


def test_a_second_of_one_track_is_one_witness_however_fast_the_sensor():
    """A hundred boxes of a hundredth each weigh as one."""
    slow, fast = (np.array([0.2, 1.0]), np.eye(2)), (np.array([0.2, 1.0]), np.eye(2))
    learn_worth(*slow, 0.7, True, 1.0)
    for _ in range(100):
        learn_worth(*fast, 0.7, True, 0.01)
    np.testing.assert_allclose(fast[0], slow[0], atol=0.02)
    np.testing.assert_allclose(fast[1], slow[1], atol=0.02)


@settings(max_examples=30)
@given(st.lists(st.tuples(ODDS, st.booleans(), st.floats(0.001, 50.0)), min_size=1, max_size=60))
def test_covariance_stays_one_and_grows_back_to_the_first_assumption_at_most(boxes):
    mean, cov = np.array([0.6, 1.0]), np.eye(2)
    for odds, lasts, weight in boxes:
        learn_worth(mean, cov, odds, lasts, weight)
        doubt_worth(cov, 1.0, 1e-3)
        assert np.all(np.linalg.eigvalsh(cov) > 0.0)
        assert np.all(np.diag(cov) <= 1.0)
        assert mean[1] >= 0.0
    for _ in range(1000):
        doubt_worth(cov, 1.0, 1e-3)
    np.testing.assert_allclose(np.diag(cov), 1.0, atol=1e-9)
