"""What sensors are off by: against dense regression with priors over all pairs at once."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jeat_graph.filters.box_offsets import (
    NUM_SUMS,
    add_pair,
    noise_factors,
    solve_offsets,
    tail_weight,
)

STD = np.array([[0.02, 1.0, 0.05], [0.08, 3.0, 0.15], [0.05, 0.5, 0.3]])


def pairs_of(count, num_sensors, seed):
    """Random pairs: sensors s < o, axis, side, then differences and precisions of centre and ln side."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        s, o = np.sort(rng.choice(num_sensors, 2, replace=False))
        side = float(np.exp(rng.normal(4.0, 0.7)))
        values = rng.normal(0.0, 4.0), rng.uniform(0.05, 1.0), rng.normal(0.0, 0.3), rng.uniform(10.0, 100.0)
        yield int(s), int(o), int(rng.integers(2)), side, *values


def summed(pairs, num_sensors):
    sums = np.zeros((num_sensors, num_sensors, 2, NUM_SUMS))
    for s, o, axis, *pair in pairs:
        add_pair(sums[s, o, axis], *pair, 1.0)
    return sums


def solve(pairs, std, factors=None):
    S = len(std)
    offsets = np.zeros((S, 2, 3))
    solve_offsets(summed(pairs, S), np.ones((S, S, 2, 2)) if factors is None else factors, std, offsets)
    return offsets


def dense(pairs, std, factors, axis):
    """Posterior means of (b, c) of all sensors and of d, by the rows of a design matrix."""
    S = len(std)
    centre, sizes = [np.diag(1.0 / std[:, :2].ravel() ** 2)], [np.diag(1.0 / std[:, 2] ** 2)]
    right, size_right = np.zeros(2 * S), np.zeros(S)
    for s, o, where, side, e, p, f, q in pairs:
        if where != axis:
            continue
        row, one = np.zeros(2 * S), np.zeros(S)
        row[2 * s : 2 * s + 2], row[2 * o : 2 * o + 2] = (side, 1.0), (-side, -1.0)
        one[s], one[o] = 1.0, -1.0
        p, q = p / factors[s, o, axis, 0], q / factors[s, o, axis, 1]
        centre.append(p * np.outer(row, row))
        sizes.append(q * np.outer(one, one))
        right += p * e * row
        size_right += q * f * one
    return np.linalg.solve(sum(centre), right), np.linalg.solve(sum(sizes), size_right)


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 60), st.integers(2, 3), st.integers(0, 10_000))
def test_offsets_are_those_of_regression_over_all_pairs(count, num_sensors, seed):
    pairs, std = list(pairs_of(count, num_sensors, seed)), STD[:num_sensors]
    factors = np.random.default_rng(seed).uniform(1.0, 9.0, (num_sensors, num_sensors, 2, 2))
    offsets = solve(pairs, std, factors)
    for axis in range(2):
        centre, size = dense(pairs, std, factors, axis)
        np.testing.assert_allclose(offsets[:, axis, :2].ravel(), centre, rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(offsets[:, axis, 2], size, rtol=1e-7, atol=1e-9)


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 60), st.floats(0.1, 10.0), st.integers(0, 10_000))
def test_noise_is_what_the_residuals_say(count, prior_s, seed):
    """(prior + Σ p (e − b a − c)²) / (prior + Σ 1), pair by pair, and no less than 1."""
    difference = np.array([0.02, -1.5, 0.1])
    pairs = [pair for pair in pairs_of(count, 2, seed) if pair[2] == 0]
    centre = sum(p * (e - difference[0] * a - difference[1]) ** 2 for *_, a, e, p, _, _ in pairs)
    size = sum(q * (f - difference[2]) ** 2 for *_, f, q in pairs)
    found = noise_factors(summed(pairs, 2)[0, 1, 0], difference, prior_s)
    expected = [max((prior_s + rest) / (prior_s + len(pairs)), 1.0) for rest in (centre, size)]
    np.testing.assert_allclose(found, expected, rtol=1e-8)


def test_without_pairs_nothing_is_off():
    offsets = solve([], STD)
    assert (offsets == 0.0).all()


def test_who_is_never_off_stays_and_the_other_takes_all_of_the_difference():
    std = np.array([[0.0, 0.0, 0.0], [0.08, 3.0, 0.15]])
    pairs = [(0, 1, 0, side, 0.0, 1e4, -0.3, 1e6) for side in (20.0, 50.0, 90.0)]
    offsets = solve(pairs, std)
    assert (offsets[0] == 0.0).all()
    assert offsets[1, 0, 2] == pytest.approx(0.3, rel=1e-3)
    assert (offsets[1, 1] == 0.0).all(), "the other axis has not been seen"


def test_of_two_the_one_that_may_be_off_by_more_is_corrected_by_more():
    """With independent normal priors a difference is shared as their variances are."""
    pairs = [(0, 1, 1, 50.0, 0.0, 1.0, 0.4, 1e9)]
    offsets = solve(pairs, STD[:2])
    first, second = offsets[0, 1, 2], offsets[1, 1, 2]
    assert first - second == pytest.approx(0.4, rel=1e-5)
    assert -second / first == pytest.approx((STD[1, 2] / STD[0, 2]) ** 2, rel=1e-5)


def test_a_share_of_the_side_and_pixels_are_told_apart_by_sizes():
    """A sensor whose boxes are all 6 px to the right, beside one whose miss grows with the size."""
    sides = np.linspace(20.0, 200.0, 40)
    for share, px in ((0.0, 6.0), (0.06, 0.0)):
        std = np.array([[0.0, 0.0, 0.0], [0.1, 5.0, 0.1]])
        offsets = solve([(0, 1, 0, a, -(share * a + px), 100.0, 0.0, 1.0) for a in sides], std)
        np.testing.assert_allclose(offsets[1, 0, :2], (share, px), atol=0.02)


@given(st.floats(0.0, 1e3), st.floats(0.5, 30.0))
def test_pairs_far_from_what_is_expected_weigh_less(distance, freedom):
    weight = tail_weight(distance, 4, freedom)
    assert weight == pytest.approx((freedom + 4.0) / (freedom + distance))
    assert tail_weight(distance + 1.0, 4, freedom) < weight
