"""What sensors are off by: against dense regression with priors over all pairs at once."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jeat_graph.filters.box_offsets import (
    NUM_SUMS,
    add_pair,
    centre_offset,
    lags_of,
    middle_of,
    noise_factors,
    solve_offsets,
    tail_weight,
)

STD = np.array([[0.02, 1.0, 0.05, 0.002, 0.01], [0.08, 3.0, 0.15, 0.02, 0.05], [0.05, 0.5, 0.3, 0.01, 0.1]])
NEVER_OFF = (0.0, 0.0, 0.0, 0.0, 0.0)


def pairs_of(count, num_sensors, seed):
    """Random pairs: sensors s < o, axis, terms, then differences and precisions of centre and ln side."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        s, o = np.sort(rng.choice(num_sensors, 2, replace=False))
        place = rng.uniform(0.0, 640.0), rng.uniform(0.0, 384.0)
        terms = at(float(np.exp(rng.normal(4.0, 0.7))), *place, rng.normal(0.0, 100.0))
        values = rng.normal(0.0, 4.0), rng.uniform(0.05, 1.0), rng.normal(0.0, 0.3), rng.uniform(10.0, 100.0)
        yield int(s), int(o), int(rng.integers(2)), terms, *values


def at(side, x=320.0, y=192.0, velocity=0.0):
    """The terms of a vehicle of that side; in the middle of the picture, and it stands."""
    return np.array([side, 1.0, x, y, velocity])


def summed(pairs, num_sensors):
    sums = np.zeros((num_sensors, num_sensors, 2, NUM_SUMS))
    for s, o, axis, *pair in pairs:
        add_pair(sums[s, o, axis], *pair, 1.0)
    return sums


def solve(pairs, std, factors=None):
    S = len(std)
    offsets = np.zeros((S, 2, 6))
    solve_offsets(summed(pairs, S), np.ones((S, S, 2, 2)) if factors is None else factors, std, offsets)
    return offsets


def dense(pairs, std, factors, axis):
    """Posterior means of (b, c, e_x, e_y, τ) of all sensors and of d, by the rows of a design matrix."""
    S = len(std)
    prior = std[:, [0, 1, 3, 3, 4]].ravel()
    centre, sizes = [np.diag(1.0 / prior**2)], [np.diag(1.0 / std[:, 2] ** 2)]
    right, size_right = np.zeros(5 * S), np.zeros(S)
    middle = np.average([pair[3][2:4] for pair in pairs], axis=0, weights=[pair[5] for pair in pairs])
    for s, o, where, terms, e, p, f, q in pairs:
        if where != axis:
            continue
        row, one = np.zeros(5 * S), np.zeros(S)
        linear = np.concatenate([terms[:2], terms[2:4] - middle, terms[4:]])
        row[5 * s : 5 * s + 5], row[5 * o : 5 * o + 5] = linear, -linear
        one[s], one[o] = 1.0, -1.0
        p, q = p / factors[s, o, axis, 0], q / factors[s, o, axis, 1]
        centre.append(p * np.outer(row, row))
        sizes.append(q * np.outer(one, one))
        right += p * e * row
        size_right += q * f * one
    found = np.linalg.solve(sum(centre), right).reshape(S, 5)
    found[:, 1] -= found[:, 2:4] @ middle
    return found, np.linalg.solve(sum(sizes), size_right)


@settings(deadline=None, max_examples=15)
@given(st.integers(1, 60), st.integers(2, 3), st.integers(0, 10_000))
def test_offsets_are_those_of_regression_over_all_pairs(count, num_sensors, seed):
    pairs, std = list(pairs_of(count, num_sensors, seed)), STD[:num_sensors]
    factors = np.random.default_rng(seed).uniform(1.0, 9.0, (num_sensors, num_sensors, 2, 2))
    offsets = solve(pairs, std, factors)
    for axis in range(2):
        centre, size = dense(pairs, std, factors, axis)
        np.testing.assert_allclose(offsets[:, axis][:, [0, 1, 3, 4, 5]], centre, rtol=1e-7, atol=1e-7)
        np.testing.assert_allclose(offsets[:, axis, 2], size, rtol=1e-7, atol=1e-9)


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 60), st.floats(0.1, 10.0), st.integers(0, 10_000))
def test_noise_is_what_the_residuals_say(count, prior_s, seed):
    """(prior + Σ p (r − offset)²) / (prior + Σ 1), pair by pair, and no less than 1."""
    difference = np.array([0.02, -1.5, 0.1, 0.01, -0.005, 0.03])
    pairs = [pair for pair in pairs_of(count, 2, seed) if pair[2] == 0]
    off = [centre_offset(difference, a[0], a[2], a[3]) + difference[5] * a[4] for *_, a, _, _, _, _ in pairs]
    centre = sum(p * (e - one) ** 2 for (*_, e, p, _, _), one in zip(pairs, off, strict=True))
    size = sum(q * (f - difference[2]) ** 2 for *_, f, q in pairs)
    found = noise_factors(summed(pairs, 2)[0, 1, 0], difference, prior_s)
    expected = [max((prior_s + rest) / (prior_s + len(pairs)), 1.0) for rest in (centre, size)]
    np.testing.assert_allclose(found, expected, rtol=1e-7)


def test_without_pairs_nothing_is_off():
    offsets = solve([], STD)
    assert (offsets == 0.0).all()


def test_who_is_never_off_stays_and_the_other_takes_all_of_the_difference():
    std = np.array([NEVER_OFF, [0.08, 3.0, 0.15, 0.01, 0.1]])
    pairs = [(0, 1, 0, at(side), 0.0, 1e4, -0.3, 1e6) for side in (20.0, 50.0, 90.0)]
    offsets = solve(pairs, std)
    assert (offsets[0] == 0.0).all()
    assert offsets[1, 0, 2] == pytest.approx(0.3, rel=1e-3)
    assert (offsets[1, 1] == 0.0).all(), "the other axis has not been seen"


def test_of_two_the_one_that_may_be_off_by_more_is_corrected_by_more():
    """With independent normal priors a difference is shared as their variances are."""
    pairs = [(0, 1, 1, at(50.0), 0.0, 1.0, 0.4, 1e9)]
    offsets = solve(pairs, STD[:2])
    first, second = offsets[0, 1, 2], offsets[1, 1, 2]
    assert first - second == pytest.approx(0.4, rel=1e-5)
    assert -second / first == pytest.approx((STD[1, 2] / STD[0, 2]) ** 2, rel=1e-5)


def test_a_share_of_the_side_and_pixels_are_told_apart_by_sizes():
    """A sensor whose boxes are all 6 px to the right, beside one whose miss grows with the size."""
    sides = np.linspace(20.0, 200.0, 40)
    for share, px in ((0.0, 6.0), (0.06, 0.0)):
        std = np.array([NEVER_OFF, [0.1, 5.0, 0.1, 0.02, 0.1]])
        offsets = solve([(0, 1, 0, at(a), -(share * a + px), 100.0, 0.0, 1.0) for a in sides], std)
        found = offsets[1, 0]
        np.testing.assert_allclose(
            (found[0], centre_offset(found, 0.0, 320.0, 192.0)), (share, px), atol=0.02
        )


def test_pictures_that_are_turned_and_scaled_against_one_another_are_put_over_one_another():
    """The second camera has a focal length 1 % longer and is turned by half a degree about its axis."""
    rng = np.random.default_rng(11)
    scale, turn = 1.01, np.deg2rad(0.5)
    move = scale * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) - np.eye(2)
    std = np.array([NEVER_OFF, [0.1, 5.0, 0.1, 0.02, 0.1]])
    places, sides = rng.uniform((0.0, 0.0), (1280.0, 720.0), (60, 2)), rng.uniform(20.0, 120.0, 60)
    off = (places - (640.0, 360.0)) @ move.T
    pairs = [
        (0, 1, axis, at(side, *place), -shift[axis], 10.0, 0.0, 1.0)
        for axis in range(2)
        for place, side, shift in zip(places, sides, off, strict=True)
    ]
    offsets = solve(pairs, std)
    assert (offsets[0] == 0.0).all()
    for place, side, shift in zip(places, sides, off, strict=True):
        found = [centre_offset(offsets[1, axis], side, *place) for axis in range(2)]
        np.testing.assert_allclose(found, shift, atol=0.05)


def test_what_is_late_is_told_from_what_is_aside():
    """The second of three is .08 s late and 5 px to the right; the third has met nobody."""
    rng = np.random.default_rng(12)
    velocity = rng.uniform(-300.0, 300.0, (40, 2))
    std = np.array([NEVER_OFF, [0.1, 5.0, 0.1, 0.02, 0.1], [0.1, 5.0, 0.1, 0.02, 0.1]])
    pairs = [
        (0, 1, axis, at(50.0, *rng.uniform(0.0, 640.0, 2), v[axis]), 0.08 * v[axis] - 5.0, 4.0, 0.0, 1.0)
        for v in velocity
        for axis in range(2)
    ]
    factors = np.ones((3, 3, 2, 2))
    offsets = solve(pairs, std, factors)
    np.testing.assert_allclose([centre_offset(one, 50.0, 320.0, 320.0) for one in offsets[1]], 5.0, atol=0.05)
    lag, of_lag = lags_of(summed(pairs, 3), factors, offsets)
    np.testing.assert_allclose(lag, (0.0, 0.08, 0.0), atol=1e-3)
    # Weighted least squares with one unknown: 1 / Σ p v²
    assert of_lag[1] == pytest.approx((4.0 * (velocity**2).sum()) ** -0.5)
    assert of_lag[2] == np.inf
    # Of the youngest nothing is asked: it is the others that are late.
    late = lags_of(summed(pairs, 3), factors, offsets * [[[-1.0]], [[-1.0]], [[-1.0]]])[0]
    np.testing.assert_allclose(late, (0.08, 0.0, 0.0), atol=1e-3)


def test_the_middle_is_where_vehicles_have_been():
    pairs = list(pairs_of(30, 3, 5))
    places, weights = [pair[3][2:4] for pair in pairs], [pair[5] for pair in pairs]
    np.testing.assert_allclose(middle_of(summed(pairs, 3)), np.average(places, axis=0, weights=weights))
    assert middle_of(summed([], 3)) == (0.0, 0.0)


@given(st.floats(0.0, 1e3), st.floats(0.5, 30.0))
def test_pairs_far_from_what_is_expected_weigh_less(distance, freedom):
    weight = tail_weight(distance, 4, freedom)
    assert weight == pytest.approx((freedom + 4.0) / (freedom + distance))
    assert tail_weight(distance + 1.0, 4, freedom) < weight
