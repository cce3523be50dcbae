"""One sensor's parameters are found again in samples drawn with them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jeat_graph.calibration.rounding import with_estimates
from jeat_graph.calibration.sensor import fit_detection, fit_noise, fit_precision, robust_std
from jeat_graph.config.schema import SensorConfig


@pytest.mark.parametrize(("sigma", "rho"), [(0.6, 0.03), (3.0, 0.01), (1.0, 0.1)])
def test_noise_of_centre_is_split_into_constant_and_size_dependent_part(sigma, rho):
    rng = np.random.default_rng(0)
    side = np.exp(rng.uniform(np.log(8.0), np.log(300.0), 8000))
    residual = rng.normal(size=8000) * np.sqrt(sigma**2 + (rho * side) ** 2)
    found = fit_noise(residual, side)
    assert found == pytest.approx((sigma, rho), rel=0.1)


def test_noise_is_that_of_the_bulk_when_some_errors_are_gross():
    rng = np.random.default_rng(1)
    side = np.exp(rng.uniform(np.log(8.0), np.log(300.0), 8000))
    residual = rng.normal(size=8000) * np.sqrt(1.0 + (0.03 * side) ** 2)
    residual[::25] *= 15.0
    assert fit_noise(residual, side) == pytest.approx((1.0, 0.03), rel=0.15)


def test_robust_std_of_a_clean_normal_sample_is_its_std():
    x = np.random.default_rng(2).normal(3.0, 2.0, 20000)
    assert robust_std(x) == pytest.approx(2.0, rel=0.02)


def test_sensor_that_sees_what_stands_has_no_blind_speed():
    rng = np.random.default_rng(3)
    speed = rng.exponential(60.0, 4000)
    p, blind = fit_detection(rng.random(4000) < 0.8, speed, np.ones(4000))
    assert p == pytest.approx(0.8, abs=0.02)
    assert blind == 0.0


@pytest.mark.parametrize("v_blind", [5.0, 25.0])
def test_blind_speed_and_detection_probability_of_an_event_camera(v_blind):
    rng = np.random.default_rng(4)
    speed = rng.exponential(40.0, 20000)
    seen = rng.random(20000) < 0.7 * (1.0 - np.exp(-((speed / v_blind) ** 2)))
    p, blind = fit_detection(seen, speed, np.ones(20000))
    assert p == pytest.approx(0.7, abs=0.03)
    assert blind == pytest.approx(v_blind, rel=0.1)


def test_hidden_vehicles_do_not_lower_the_detection_probability():
    rng = np.random.default_rng(5)
    visible = np.where(rng.random(4000) < 0.4, 0.2, 1.0)
    seen = rng.random(4000) < 0.9 * visible
    p, _ = fit_detection(seen, np.full(4000, np.nan), visible)
    assert p == pytest.approx(0.9, abs=0.02)


def test_precision_curve_follows_the_true_precision():
    rng = np.random.default_rng(6)
    score = rng.random(40000)
    knots = np.array(fit_precision(score, rng.random(40000) < score**2))
    assert np.abs(np.interp(knots[:, 0], knots[:, 0], knots[:, 1]) - knots[:, 0] ** 2).max() < 0.06


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.floats(0, 1), st.booleans()), min_size=1, max_size=300))
def test_precision_curve_is_always_valid_in_a_configuration(rows):
    from jeat_graph.config.schema import SensorConfig

    score, correct = np.array([r[0] for r in rows]), np.array([r[1] for r in rows])
    knots = fit_precision(score, correct)
    SensorConfig(score_precision=knots)
    assert all(0.0 < p < 1.0 for _, p in knots)


def test_boxes_without_any_noise_calibrate_a_sensor():
    """What has no error has estimates that are closer to 0 than a setting may be: they are 0."""
    section = with_estimates(SensorConfig(rate_hz=20.0), rho_x=6e-29, rho_y=0.02, bias=(1e-30, 0.0, 0.5, 0.0))
    assert (section.rho_x, section.rho_y, section.bias) == (0.0, 0.02, (0.0, 0.0, 0.5, 0.0))
