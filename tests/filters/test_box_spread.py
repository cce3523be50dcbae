"""Spreads that a detector gives with its boxes, as R: against a closed form, drawn errors, and bounds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from jeat_graph.filters import box_sides, box_spread, noise_learning, singer
from jeat_graph.filters.model_constants import ModelConstants

C = ModelConstants()
#: ln ρ² of the sensor, and of its sides with what lasts of its errors.
OWN, WITH_LASTING = 2.0 * math.log(0.08), 2.0 * math.log(0.13)
BOX = np.array([[200.0, 300.0, 300.0, 360.0]])
WHOLE = np.zeros((1, 2, 2), dtype=bool)
STD = np.array([[3.0, 8.0, 20.0, 1.5]])


def by_hand(std, size, f2):
    """R (2, 2) by axis and side of standard deviations left, top, right, bottom and an object's size."""
    both = math.sqrt(size[0] * size[1])
    R = np.zeros((2, 2))
    for axis in range(2):
        s = 0.5 * both + 0.5 * size[axis]
        for side in range(2):
            lasts = (math.exp(WITH_LASTING) - math.exp(OWN)) * s**2
            R[axis, side] = f2 * std[2 * side + axis] ** 2 + lasts + C.pixel_std**2
    return R


@pytest.mark.parametrize("f2", [1.0, 2.25])
def test_an_update_is_the_closed_form_with_the_noise_of_that_box(f2):
    rng = np.random.default_rng(3)
    L = rng.normal(size=(1, 2, 7, 7))
    P = L @ L.transpose(0, 1, 3, 2) + 0.1 * np.eye(7)
    mean = np.zeros((1, 2, 7))
    mean[..., singer.POSITION], mean[..., singer.LOG_SIZE] = [252.0, 328.0], np.log([104.0, 58.0])
    size = singer.expected_size(mean)
    squares = box_spread.squares(STD, BOX[:, 2:] - BOX[:, :2], C)
    more = box_spread.more_variance(squares, BOX[:, 2:] - BOX[:, :2], size[:, None], OWN, f2)
    seen = box_sides.innovations(mean, P, BOX, WHOLE, WITH_LASTING, C, more)
    R = by_hand(STD[0], size[0], f2)
    np.testing.assert_allclose(seen.side_variance[0, 0], R, rtol=1e-12)
    after, covariance = box_sides.update(mean, P, seen.y[:, 0], seen.H, seen.side_variance[:, 0])
    for axis in range(2):
        H, y = seen.H[0, axis], seen.y[0, 0, axis]
        np.testing.assert_allclose(seen.S[0, 0, axis], H @ P[0, axis] @ H.T + np.diag(R[axis]), rtol=1e-12)
        information = np.linalg.inv(P[0, axis]) + H.T @ np.diag(1.0 / R[axis]) @ H
        want = np.linalg.inv(information)
        np.testing.assert_allclose(covariance[0, axis], want, rtol=1e-6, atol=1e-7)
        np.testing.assert_allclose(after[0, axis], mean[0, axis] + want @ H.T @ (y / R[axis]), rtol=1e-6)


def test_a_side_without_a_spread_has_the_variance_of_the_sensor():
    std = np.where(np.arange(4) == 2, np.nan, STD)
    size = BOX[:, 2:] - BOX[:, :2]
    more = box_spread.more_variance(box_spread.squares(std, size, C), size, size, OWN, 1.0)
    assert more[0, 0, 1] == 0.0
    assert np.count_nonzero(more) == 3


def test_spreads_beyond_the_bounds_count_as_these():
    size = np.array([[100.0, 100.0]])
    found = box_spread.squares(np.array([[0.0, 1e9, 5.0, np.nan]]), size, C)[0]
    np.testing.assert_allclose(found, [[0.01**2, 0.05**2], [1.0, np.nan]])


def test_a_birth_knows_the_better_side_better():
    """The centre errs as the worse side does, and with it the size: covariance of independent sides."""
    size, R = np.array([100.0, 60.0]), by_hand(STD[0], np.array([100.0, 60.0]), 1.0)
    squares = box_spread.squares(STD, size[None], C)
    more = box_spread.more_variance(squares, size[None], size[None], OWN, 1.0)
    _, P = box_sides.initial_state(BOX, WHOLE, WITH_LASTING, WITH_LASTING, C, more)
    for axis in range(2):
        # [p, l] of the sides by first differences.
        J = np.array([[0.5, 0.5], [-1.0 / size[axis], 1.0 / size[axis]]])
        want = J @ np.diag(R[axis]) @ J.T
        two = np.ix_([singer.POSITION, singer.LOG_SIZE], [singer.POSITION, singer.LOG_SIZE])
        np.testing.assert_allclose(P[0, axis][two], want, rtol=1e-9)


@pytest.mark.parametrize("factor", [0.5, 1.0, 1.5])
def test_innovations_tell_by_which_factor_spreads_are_too_small(factor):
    """Of boxes whose errors, of Student's t, have `factor` times the standard deviations that are said."""
    rng = np.random.default_rng(5)
    log_variance, square, nu = 2.0 * math.log(C.side_std), math.nan, C.degrees_of_freedom
    unit = math.sqrt((nu - 2.0) / nu)
    found = []
    for _ in range(3000):
        spread = np.exp(rng.uniform(math.log(0.08), math.log(0.3), (8, 2, 2)))
        errors = factor * spread * unit * rng.standard_t(nu, (8, 2, 2))
        log_variance, square = box_spread.learn_mean_square(log_variance, square, spread**2, 1.0, C)
        f = math.sqrt(box_spread.gain(log_variance, square))
        e = (errors / (f * spread)).reshape(8, 4)
        log_variance = noise_learning.learn_measurement_noise(log_variance, np.clip(e, -3, 3), 1.0, C)
        found.append(f)
    assert np.mean(found[1000:]) == pytest.approx(factor, rel=0.1)


def test_a_change_of_all_spreads_is_believed_at_once():
    """As by night: f stays, so R is four times as large from the first scan on."""
    log_variance, square = 2.0 * math.log(0.12), 0.01
    f2 = box_spread.gain(log_variance, square)
    for _ in range(50):
        given = np.full((4, 2, 2), 0.04)
        log_variance, square = box_spread.learn_mean_square(log_variance, square, given, 1.0, C)
        assert box_spread.gain(log_variance, square) == pytest.approx(f2, rel=1e-9)
    assert square == pytest.approx(0.04, rel=0.1)


def test_at_first_they_are_believed_as_they_are():
    log_variance, square = box_spread.learn_mean_square(-4.0, math.nan, np.full((1, 2, 2), 0.02), 0.1, C)
    assert (log_variance, square) == (pytest.approx(math.log(0.02)), 0.02)
    nothing = np.full((3, 2, 2), np.nan)
    assert box_spread.learn_mean_square(-4.0, 0.02, nothing, 1.0, C) == (-4.0, 0.02)
