"""Densities of jerk chosen by innovations: filters apart, motion of known density, turns, lasting errors."""

import math

import numpy as np
import pytest
from scipy.stats import norm

from jeat_graph.filters.coloured_noise import predict_errors, update_centre
from jeat_graph.filters.kalman import predict
from jeat_graph.filters.manoeuvre import (
    density_factor,
    mean_factor,
    predict_manoeuvres,
    prior_weights,
    relax_weights,
    weigh_manoeuvres,
)
from jeat_graph.filters.motion import process_noise, transition

CALM, STEP, SIZE, DT, MEMORY_S = 4.0, 6.0, 60.0, 1 / 15, 0.7
DENSITIES = SIZE * np.array([1.0 / CALM, 1.0, STEP])
CORRELATION_TIME = np.array([MEMORY_S])
WHITE = np.full(2, 0.5 * (0.045 * SIZE) ** 2)
COLOURED = np.sqrt(WHITE)
BOTH = np.ones(2)


def bank():
    """Filters of one track that knows its first state as a new track does, with an error state."""
    mean = np.zeros((1, 3, 2, 4))
    cov = np.zeros((1, 3, 2, 4, 4))
    cov[...] = np.diag([(0.045 * SIZE) ** 2, (3.9 * SIZE) ** 2, (2.0 * SIZE) ** 2, 1.0])
    return mean, cov, prior_weights(0.1, 0.05)[None].copy()


def run(z, *, usual=None, say=BOTH):
    """Mean factor on the jerk over the second half of the measured positions z (K, 2), and the weights."""
    mean, cov, weight = bank()
    usual = prior_weights(0.1, 0.05) if usual is None else usual
    factors = []
    for point in z:
        relax_weights(weight, usual, DT, 2.0)
        factors.append(mean_factor(weight[0], CALM, STEP))
        predict_manoeuvres(mean, cov, DENSITIES, CORRELATION_TIME, DT, np.zeros(3, dtype=bool), 0.2)
        weigh_manoeuvres(mean[0], cov[0], weight[0], point, WHITE, COLOURED, 0, say)
    return math.exp(np.mean(np.log(factors[len(z) // 2 :])))


def detector_errors(rng, num, share=0.5):
    """Errors (num, 2) of a detector that misses by 4.5 % of the size, a share of the variance lasting."""
    phi = math.exp(-DT / MEMORY_S)
    lasting = np.empty((num, 2))
    lasting[0] = rng.normal(size=2)
    for k in range(1, num):
        lasting[k] = phi * lasting[k - 1] + math.sqrt(1 - phi * phi) * rng.normal(size=2)
    return 0.045 * SIZE * (math.sqrt(share) * lasting + math.sqrt(1 - share) * rng.normal(size=(num, 2)))


def white_jerk_path(rng, num, density):
    """Positions (num, 2) of a motion whose jerk is white, of a root spectral density (px/s^2.5)."""
    F, root = transition(DT), np.linalg.cholesky(process_noise(DT, density) + 1e-18 * np.eye(3))
    state, out = np.zeros((3, 2)), np.empty((num, 2))
    for k in range(num):
        state = F @ state + root @ rng.normal(size=(3, 2))
        out[k] = state[0]
    return out


def test_the_weights_are_those_of_filters_that_run_apart():
    """Bayes' rule over Kalman filters that know nothing of each other, scan by scan."""
    rng = np.random.default_rng(1)
    mean, cov, weight = bank()
    apart = [(m[None].copy(), P[None].copy()) for m, P in zip(mean[0], cov[0], strict=True)]
    log_odds = np.log(weight[0])
    for z in white_jerk_path(rng, 12, 2 * SIZE) + detector_errors(rng, 12):
        predict_manoeuvres(mean, cov, DENSITIES, CORRELATION_TIME, DT, np.zeros(3, dtype=bool), 0.0)
        nis, usual = weigh_manoeuvres(mean[0], cov[0], weight[0], z, WHITE, COLOURED, 0, BOTH)
        each = np.empty(3)
        for k, (m, P) in enumerate(apart):
            predict(m, P, DENSITIES[k : k + 1], DT)
            predict_errors(m, P, CORRELATION_TIME, DT)
            h = np.array([1.0, 0.0, 0.0, COLOURED[0]])
            for axis in range(2):
                std = math.sqrt(h @ P[0, axis] @ h + WHITE[axis])
                log_odds[k] += norm.logpdf(z[axis], h @ m[0, axis], std)
            each[k] = update_centre(m[0], P[0], z, WHITE, COLOURED, 0)
            assert mean[0, k] == pytest.approx(m[0])
            assert cov[0, k] == pytest.approx(P[0])
        expected = np.exp(log_odds - log_odds.max())
        expected /= expected.sum()
        assert weight[0] == pytest.approx(expected)
        assert nis == pytest.approx(expected @ each)
        assert usual == pytest.approx(each[1])


@pytest.mark.parametrize("which", [0, 1, 2])
def test_motion_of_a_known_density_is_recovered(which):
    """Of white jerk with one of the three densities, the mean over some tracks is within a factor of 1.6."""
    usual = np.full(3, 1 / 3)
    factors = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        z = white_jerk_path(rng, 150, DENSITIES[which]) + detector_errors(rng, 150)
        factors.append(run(z, usual=usual))
    assert abs(math.log(np.exp(np.mean(np.log(factors))) * SIZE / DENSITIES[which])) < math.log(1.6)


def test_a_turn_is_a_manoeuvre_and_a_straight_road_with_errors_that_last_is_none():
    """A roundabout at 60 px/s² and more, against constant velocity, both seen by the same detector."""
    t = DT * np.arange(120)
    for seed in range(4):
        errors = detector_errors(np.random.default_rng(seed), len(t))
        turn = 120.0 * np.stack([np.cos(2.0 * t), np.sin(2.0 * t)], axis=1)
        straight = np.stack([150.0 * t, 20.0 * t], axis=1)
        assert run(turn + errors) > 2.0
        assert run(straight + errors) < 1.2


def test_errors_that_all_last_are_no_manoeuvre():
    """All of the error's variance lasting, where half is assumed: slow wander returns, a turn does not."""
    t = DT * np.arange(150)
    straight = np.stack([150.0 * t, 20.0 * t], axis=1)
    for seed in range(4):
        assert run(straight + detector_errors(np.random.default_rng(seed), len(t), share=1.0)) < 1.2


def test_a_calm_motion_has_to_do_better_beside_noise_as_it_is():
    """Motion and noise half as large as assumed, and that told: the odds of filters that assume half."""
    rng, none = np.random.default_rng(5), np.zeros(3, dtype=bool)
    mean, cov, weight = bank()
    half_mean, half_cov, half_weight = bank()
    half = np.array([0.5, 0.5, 0.5, 1.0])
    half_cov *= half[:, None] * half
    for z in 0.5 * (white_jerk_path(rng, 20, SIZE) + detector_errors(rng, 20)):
        before, half_before = weight[0].copy(), half_weight[0].copy()
        predict_manoeuvres(mean, cov, DENSITIES, CORRELATION_TIME, DT, none, 0.0)
        weigh_manoeuvres(mean[0], cov[0], weight[0], z, WHITE, COLOURED, 0, np.full(2, 4.0))
        predict_manoeuvres(half_mean, half_cov, 0.5 * DENSITIES, CORRELATION_TIME, DT, none, 0.0)
        noise = 0.25 * WHITE, 0.5 * COLOURED
        weigh_manoeuvres(half_mean[0], half_cov[0], half_weight[0], z, *noise, 0, BOTH)
        calm, half_calm = weight[0] / before, half_weight[0] / half_before
        assert calm[0] / calm[1] == pytest.approx(half_calm[0] / half_calm[1], rel=1e-9)


def test_beside_wide_noise_a_walk_in_circles_is_not_calm():
    """Errors half as large as assumed: told so, they keep off the calm density; not told, not."""
    t = DT * np.arange(120)
    circle = 40.0 * np.stack([np.cos(0.8 * t), np.sin(0.8 * t)], axis=1)
    for seed in range(4):
        z = circle + 0.5 * detector_errors(np.random.default_rng(seed), len(t))
        assert run(z) < 0.6
        assert run(z, say=np.full(2, 4.0)) > 0.8


def test_weights_go_back_to_the_usual_ones_and_none_dies():
    weight, usual = np.array([[0.0, 0.0, 1.0]]), np.array([1.0, 0.0, 0.0])
    many = weight.copy()
    relax_weights(weight, usual, 1.0, 2.0)
    for _ in range(10):
        relax_weights(many, usual, 0.1, 2.0)
    assert many == pytest.approx(weight, rel=1e-12)
    assert weight.sum() == pytest.approx(1.0)
    assert weight[0, 2] == pytest.approx(math.exp(-0.5), rel=2e-3)
    assert weight[0, 1] > 0.0


def test_the_factor_is_the_geometric_mean():
    assert [density_factor(k, 4.0, 6.0) for k in range(3)] == [0.25, 1.0, 6.0]
    assert mean_factor(np.array([0.5, 0.25, 0.25]), 4.0, 6.0) == pytest.approx(0.25**0.5 * 6.0**0.25)
    assert mean_factor(np.array([0.0, 1.0, 0.0]), 4.0, 6.0) == 1.0
    assert prior_weights(0.1, 0.05) == pytest.approx(np.array([0.1, 1.0, 0.05]) / 1.15)


def test_an_axis_that_is_cut_has_no_say():
    mean, cov, weight = bank()
    predict_manoeuvres(mean, cov, DENSITIES, CORRELATION_TIME, DT, np.zeros(3, bool), 0.0)
    before = weight.copy()
    far = np.array([500.0, 500.0])
    weigh_manoeuvres(mean[0], cov[0], weight[0], far, WHITE, COLOURED, 0, np.zeros(2))
    assert weight == pytest.approx(before, rel=1e-12)
