"""The score at which a box is as likely real as false, against boxes drawn from a known one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from jeat_graph.calibration.even_score import even_score


def drawn(even: float, slope: float, count: int = 4000, seed: int = 0):
    """Scores (D,), and whether each box is real, with odds that are a power of those of its score."""
    rng = np.random.default_rng(seed)
    score = rng.uniform(0.05, 0.98, count)
    logit = np.log(score / (1.0 - score)) - np.log(even / (1.0 - even))
    return score, rng.random(count) < 1.0 / (1.0 + np.exp(-slope * logit))


@pytest.mark.parametrize(("even", "slope"), [(0.3, 1.0), (0.6, 2.0), (0.8, 0.5)])
def test_a_known_one_is_found(even, slope):
    assert even_score(*drawn(even, slope)) == pytest.approx(even, abs=0.04)


def test_it_is_the_maximum_of_the_likelihood():
    score, real = drawn(0.4, 1.5, 400)
    x = np.log(score / (1.0 - score))

    def loss(p):
        z = p[0] + p[1] * x
        return np.logaddexp(0.0, np.where(real, -z, z)).sum() + 0.5e-3 * p @ p

    a, b = minimize(loss, [0.0, 1.0], tol=1e-12).x
    assert even_score(score, real) == pytest.approx(1.0 / (1.0 + np.exp(a / b)), abs=1e-5)


def test_boxes_that_a_score_separates_give_a_score_between_them():
    score = np.r_[np.full(50, 0.2), np.full(50, 0.8)]
    assert 0.2 < even_score(score, score > 0.5) < 0.8


@pytest.mark.parametrize("real", [np.ones(100, bool), np.zeros(100, bool), np.arange(100) < 5])
def test_few_boxes_of_either_kind_tell_nothing(real):
    assert even_score(np.linspace(0.1, 0.9, 100), real) is None


def test_scores_that_fall_with_being_real_tell_nothing():
    score, real = drawn(0.5, 2.0)
    assert even_score(score, ~real) is None
