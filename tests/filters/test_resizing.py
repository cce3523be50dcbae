"""Densities of size changes chosen by sizes: filters apart, sizes of a known density, cut sides."""

import math

import numpy as np
import pytest
from scipy.stats import norm

from jeat_graph.filters.kalman import predict_size, update_block
from jeat_graph.filters.manoeuvre import density_factor, mean_factor, prior_weights, relax_weights
from jeat_graph.filters.motion import size_process_noise, size_transition
from jeat_graph.filters.resizing import resizing_density, weigh_resizing

CALM, CHANGE, USUAL, DT = 4.0, 8.0, 0.4, 1 / 15
DENSITIES = USUAL * np.array([density_factor(k, CALM, CHANGE) for k in range(3)])
R = np.full(2, 0.05**2)
WHOLE = np.ones(2, dtype=bool)


def bank(share=1.0):
    """Filters of one track that knows its first size as a new track does; standard deviations by a share."""
    mean, cov = np.zeros((3, 2, 2)), np.zeros((3, 2, 2, 2))
    cov[...] = share**2 * np.diag([R[0], 0.7**2])
    return mean, cov, np.full(3, 1 / 3)


def path(rng, num, density):
    """Logarithms (num, 2) of sides whose rates are driven by white noise of a root density (1/s^1.5)."""
    F, root = size_transition(DT), np.linalg.cholesky(size_process_noise(DT, density) + 1e-18 * np.eye(2))
    state, out = np.zeros((2, 2)), np.empty((num, 2))
    for k in range(num):
        state = F @ state + root @ rng.normal(size=(2, 2))
        out[k] = state[0]
    return out


def test_the_weights_are_those_of_filters_that_run_apart():
    """Bayes' rule over dense Kalman filters that know nothing of each other, box by box."""
    rng = np.random.default_rng(1)
    mean, cov, weight = bank()
    apart = [[(mean[k, a].copy(), cov[k, a].copy()) for a in range(2)] for k in range(3)]
    log_odds = np.log(weight)
    F, H = size_transition(DT), np.array([1.0, 0.0])
    for z in path(rng, 12, 0.8) + 0.05 * rng.normal(size=(12, 2)):
        predict_size(mean, cov, DENSITIES, DT)
        square = weigh_resizing(mean, cov, weight, z, R, WHOLE, 1.0)
        squares = []
        for k in range(3):
            for a in range(2):
                m, P = apart[k][a]
                m, P = F @ m, F @ P @ F.T + size_process_noise(DT, DENSITIES[k])
                S = P[0, 0] + R[a]
                log_odds[k] += norm.logpdf(z[a], m[0], math.sqrt(S))
                squares.append((z[a] - m[0]) ** 2 / S)
                K = P @ H / S
                apart[k][a] = m + K * (z[a] - m[0]), P - np.outer(K, K) * S
                assert mean[k, a] == pytest.approx(apart[k][a][0])
                assert cov[k, a] == pytest.approx(apart[k][a][1], rel=1e-6)
        expected = np.exp(log_odds - log_odds.max())
        assert weight == pytest.approx(expected / expected.sum())
        assert square == pytest.approx(np.mean(squares[2:4]))


@pytest.mark.parametrize("which", [0, 1, 2])
def test_sizes_of_a_known_density_are_recovered(which):
    """Over some tracks the mean is nearer to the density that is true than to the next one."""
    factors = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        mean, cov, weight = bank()
        for z in path(rng, 150, DENSITIES[which]) + 0.05 * rng.normal(size=(150, 2)):
            relax_weights(weight[None], np.full(3, 1 / 3), DT, 2.0)
            predict_size(mean, cov, DENSITIES, DT)
            weigh_resizing(mean, cov, weight, z, R, WHOLE, 1.0)
            factors.append(mean_factor(weight, CALM, CHANGE))
    found = USUAL * math.exp(np.mean(np.log(factors)))
    assert np.argmin(np.abs(np.log(found / DENSITIES))) == which


def test_noise_that_is_smaller_than_assumed_is_told():
    """All errors and changes half as large: told so, the odds are those of filters that assume half."""
    rng = np.random.default_rng(5)
    mean, cov, weight = bank()
    half_mean, half_cov, half_weight = bank(0.5)
    for z in 0.5 * (path(rng, 20, USUAL) + 0.05 * rng.normal(size=(20, 2))):
        predict_size(mean, cov, DENSITIES, DT)
        weigh_resizing(mean, cov, weight, z, R, WHOLE, 4.0)
        predict_size(half_mean, half_cov, 0.5 * DENSITIES, DT)
        weigh_resizing(half_mean, half_cov, half_weight, z, 0.25 * R, WHOLE, 1.0)
        assert weight == pytest.approx(half_weight, rel=1e-9)


def test_a_side_that_is_cut_has_no_say():
    mean, cov, weight = bank()
    one_mean, one_cov, one_weight = bank()
    before = weight.copy()
    assert weigh_resizing(mean, cov, weight, np.array([5.0, 5.0]), R, ~WHOLE, 1.0) == 0.0
    assert weight.tolist() == before.tolist()
    assert not mean.any()
    side = np.array([True, False])
    weigh_resizing(mean, cov, weight, np.array([0.3, 5.0]), R, side, 1.0)
    weigh_resizing(one_mean, one_cov, one_weight, np.array([0.3, -7.0]), R, side, 1.0)
    assert weight.tolist() == one_weight.tolist()
    assert not mean[:, 1].any()


def test_one_odd_box_does_not_decide():
    mean, cov, weight = bank()
    cov[:, :, 1, 1] = 0.0
    for _ in range(30):
        predict_size(mean, cov, DENSITIES, DT)
        weigh_resizing(mean, cov, weight, np.zeros(2), R, WHOLE, 1.0)
    calm = weight[0] / weight[2]
    predict_size(mean, cov, DENSITIES, DT)
    weigh_resizing(mean, cov, weight, np.full(2, 5.0), R, WHOLE, 1.0)
    assert weight[0] / weight[2] > 0.99 * calm * math.exp(-3.0)
    assert prior_weights(0.0, 0.0).tolist() == [0.0, 1.0, 0.0]


def test_what_passes_at_constant_speed_is_followed_by_the_calmest():
    """Its size goes with 1 / (t0 - t): a calm filter that knows of perspective lags by a good half."""
    lags = []
    for per_growth in (0.0, 1.0):
        mean, cov = np.zeros((1, 2, 2)), np.zeros((1, 2, 2, 2))
        cov[...] = np.diag([R[0], 0.7**2])
        off = []
        for k in range(1, 40):
            true = math.log(3.0 / (3.0 - k * DT))
            density = resizing_density(mean[0], DENSITIES[0], per_growth)
            predict_size(mean, cov, np.array([density]), DT)
            for side in range(2):
                off.append(abs(true - mean[0, side, 0]))
                update_block(mean[0, side], cov[0, side], true, R[side])
        lags.append(max(off))
    assert lags[1] < 0.6 * lags[0]


def test_perspective_takes_growth_that_both_sides_share():
    both, one = np.array([[4.0, 0.49], [4.0, 0.64]]), np.array([[4.0, 0.49], [4.0, -0.64]])
    assert resizing_density(both, 0.1, 2.0) == pytest.approx(math.hypot(0.1, 2.0 * 0.343))
    assert resizing_density(one, 0.1, 2.0) == 0.1
    assert resizing_density(both, 0.1, 0.0) == 0.1
    shrinking = both * np.array([1.0, -1.0])
    assert resizing_density(shrinking, 0.1, 2.0) == resizing_density(both, 0.1, 2.0)
    assert resizing_density(both * 1e6, 0.1, 1.0) == pytest.approx(math.hypot(0.1, 8.0))
