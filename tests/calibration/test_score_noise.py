"""How exact boxes are by their scores is found again in errors that were drawn so, and only there."""

import numpy as np
import pytest

from jeat_graph.calibration.score_noise import factors, fit_score_noise


def drawn(rng, count, factor):
    """Scores and errors (C, 4) whose deviation is `factor` of the score."""
    score = rng.beta(4.0, 2.0, count)
    return score, rng.normal(size=(count, 4)) * factor(score)[:, None]


def test_the_factor_is_found_again_up_to_its_mean():
    def factor(score):
        return 3.0 - 2.5 * score

    score, error = drawn(np.random.default_rng(0), 20000, factor)
    knots = fit_score_noise(score, error)
    at = np.linspace(0.45, 0.9, 20)
    usual = np.sqrt(np.mean(factor(score) ** 2))
    np.testing.assert_allclose(factors(at, knots), factor(at) / usual, rtol=0.08)
    assert np.mean(factors(score, knots) ** 2) == pytest.approx(1.0, rel=0.02)


@pytest.mark.parametrize("seed", range(5))
def test_scores_that_say_nothing_or_the_contrary_give_no_factor(seed):
    rng = np.random.default_rng(seed)
    assert fit_score_noise(*drawn(rng, 3000, np.ones_like)) == ()
    assert fit_score_noise(*drawn(rng, 3000, lambda score: 0.5 + score)) == ()


def test_scores_of_one_value_few_boxes_and_no_errors_give_no_factor():
    rng = np.random.default_rng(1)
    assert fit_score_noise(np.full(1000, 0.7), rng.normal(size=(1000, 4))) == ()
    assert fit_score_noise(*drawn(rng, 3, lambda score: 3.0 - 2.5 * score)) == ()
    assert fit_score_noise(np.zeros(0), np.zeros((0, 4))) == ()
    assert fit_score_noise(rng.random(100), np.zeros((100, 4))) == ()


def test_scores_that_crowd_at_one_give_knots_that_a_configuration_takes():
    rng = np.random.default_rng(2)
    score = np.where(rng.random(5000) < 0.8, 1.0, rng.random(5000))
    error = rng.normal(size=(5000, 4)) * np.where(score < 1.0, 2.0, 0.5)[:, None]
    at, value = np.array(fit_score_noise(score, error)).T
    assert (np.diff(at) > 0).all()
    assert (np.diff(value) <= 0).all()
    assert value[0] / value[-1] == pytest.approx(4.0, rel=0.15)


def test_without_knots_scores_change_nothing():
    assert factors(np.array([0.0, 0.5, 1.0]), ()).tolist() == [1.0, 1.0, 1.0]
