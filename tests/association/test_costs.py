"""Costs of a pair: the formulas, and which sensor each cost prefers."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jeat_graph.association.costs import likelihood_cost, log_evidence, log_score_ratio
from jeat_graph.association.densities import Likelihood
from jeat_graph.association.gates import Expected, Found, Pairs, gated_pairs

PROBABILITY = st.floats(0.01, 0.99)


def two_sensors(residual, variances, weights=(1.0, 1.0), track_var=4.0):
    """One track, one detection of each of two sensors at the same residual; d² and cost of both pairs."""
    flat, small = np.zeros((1, 2)), np.full((1, 2), 0.01)
    expected = Expected(
        np.zeros((1, 2, 2)),
        np.full((1, 2, 2), track_var),
        np.zeros((0, 0, 0, 0)),
        np.repeat(np.array(variances), 2).reshape(1, 2, 2),
        np.zeros((1, 2, 2)),
        flat,
        small,
        np.full((2, 2), 0.01),
        np.zeros((1, 2), dtype=np.int64),
    )
    cut = np.zeros((2, 2), dtype=np.int64), np.zeros((2, 2))
    measured = np.full((2, 2), residual), np.zeros((2, 2)), np.array(weights), np.ones(2)
    pairs = gated_pairs(expected, Found(*measured, np.array([0, 1]), *cut), Likelihood(0.0, 3.0), 1e6, np.inf)
    p_detect, sensor = np.full((1, 2), 0.9), np.array([0, 1])
    evidence = log_evidence(pairs, p_detect, np.zeros(2), np.full(2, -10.0), sensor)
    return pairs.d2, likelihood_cost(pairs.rows, pairs.cols, evidence, np.array([0.9]), p_detect, sensor)


@pytest.mark.parametrize("residual", [0.0, 0.5, 1.0, 2.0])
def test_for_the_same_small_residual_the_likelihood_prefers_the_surer_sensor(residual):
    _, cost = two_sensors(residual, (1.0, 25.0))
    assert cost[0] < cost[1]


@pytest.mark.parametrize("residual", [0.5, 1.0, 2.0, 10.0])
def test_for_the_same_residual_the_mahalanobis_distance_prefers_the_less_sure_sensor(residual):
    d2, _ = two_sensors(residual, (1.0, 25.0))
    assert d2[1] < d2[0]


def test_dividing_r_by_the_score_makes_the_doubtful_detection_the_cheaper_by_mahalanobis_only():
    d2, cost = two_sensors(2.0, (4.0, 4.0), weights=(1.0, 1.0 / 0.1))
    assert d2[1] < d2[0]
    assert cost[0] < cost[1]


@given(calibrated=PROBABILITY, overall=PROBABILITY)
def test_score_ratio_is_bayes_rule(calibrated, overall):
    # p(score | v) / p(score | f) = [p(v | score) / p(f | score)] / [p(v) / p(f)]
    expected = math.log((calibrated / (1 - calibrated)) / (overall / (1 - overall)))
    assert log_score_ratio(calibrated, overall) == pytest.approx(expected, abs=1e-9)


def test_a_score_of_the_average_precision_says_nothing():
    assert log_score_ratio(0.8, 0.8) == 0.0
    assert log_score_ratio(0.9, 0.8) > 0.0 > log_score_ratio(0.7, 0.8)


@given(seed=st.integers(0, 10**6), num=st.integers(0, 20))
@settings(max_examples=50, deadline=None)
def test_evidence_and_cost_are_their_formulas(seed, num):
    rng = np.random.default_rng(seed)
    rows, cols = rng.integers(0, 5, num), rng.integers(0, 6, num)
    density, size_density = rng.normal(-5, 3, num), rng.normal(0, 1, num)
    pairs = Pairs(rows, cols, np.zeros(num), density, size_density)
    p_detect, existence = rng.uniform(0.01, 0.99, (5, 2)), rng.uniform(0.01, 0.99, 5)
    score, clutter, sensor = rng.normal(size=6), rng.normal(-12, 1, 2), rng.integers(0, 2, 6)
    evidence = log_evidence(pairs, p_detect, score, clutter, sensor)
    cost = likelihood_cost(rows, cols, evidence, existence, p_detect, sensor)
    for p, (i, j) in enumerate(zip(rows, cols, strict=True)):
        pd, r = p_detect[i, sensor[j]], existence[i]
        ratio = (
            pd
            * math.exp(density[p])
            * math.exp(size_density[p])
            * math.exp(score[j])
            / math.exp(clutter[sensor[j]])
        )
        assert evidence[p] == pytest.approx(math.log(ratio), abs=1e-9)
        assert cost[p] == pytest.approx(-math.log(r * ratio / (1 - r * pd)), abs=1e-9)


def test_a_pair_pays_exactly_where_it_is_more_probable_than_a_miss_and_a_false_box():
    rows = cols = np.zeros(1, dtype=np.int64)
    sensor, r, pd = np.zeros(1, dtype=np.int64), 0.6, 0.8
    break_even = math.log((1 - r * pd) / r)
    for shift, sign in ((-0.1, 1), (0.1, -1)):
        evidence = np.array([break_even + shift])
        cost = likelihood_cost(rows, cols, evidence, np.array([r]), np.array([[pd]]), sensor)
        assert np.sign(cost[0]) == sign


def test_certain_and_impossible_inputs_stay_finite():
    index = np.zeros(1, dtype=np.int64)
    for r in (0.0, 1.0):
        for pd in (0.0, 1.0):
            p_detect = np.array([[pd]])
            pairs = Pairs(index, index, np.zeros(1), np.zeros(1), np.zeros(1))
            evidence = log_evidence(pairs, p_detect, np.zeros(1), np.zeros(1), index)
            cost = likelihood_cost(index, index, evidence, np.array([r]), p_detect, index)
            assert np.isfinite(evidence).all()
            assert np.isfinite(cost).all()
