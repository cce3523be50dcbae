"""The Singer model against numeric integration, and against constant acceleration for long times."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad_vec, solve_ivp

from jeat_graph.filters import motion, singer
from jeat_graph.filters.model_constants import ModelConstants

C = ModelConstants()
STEPS = [1e-3, 0.04, 0.5, 2.7]
DRIVEN = {"position": 0, "jerk": 2, "size": 3, "growth": 4}


@pytest.mark.parametrize("dt", STEPS)
def test_transition_solves_the_differential_equation(dt):
    start = np.array([3.0, -2.0, 5.0, 0.3, 0.7, 1.5, -0.2])
    A = singer.drift(C)
    end = solve_ivp(lambda _, x: A @ x, (0.0, dt), start, rtol=1e-11, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(singer.discretise(dt, C).F @ start, end, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("dt", STEPS)
@pytest.mark.parametrize("noise", DRIVEN)
def test_process_noise_is_the_integral_of_what_is_driven(dt, noise):
    def integrand(s):
        F, term = np.eye(singer.STATES), np.eye(singer.STATES)
        for n in range(1, 60):  # the exponential's series, not the function that the code uses
            term = term @ singer.drift(C) * (s / n)
            F = F + term
        return np.outer(F[:, DRIVEN[noise]], F[:, DRIVEN[noise]])

    want, _ = quad_vec(integrand, 0.0, dt, epsrel=1e-11)
    got = getattr(singer.discretise(dt, C), noise)
    np.testing.assert_allclose(got, want, rtol=1e-7, atol=1e-9 * np.abs(want).max())


@pytest.mark.parametrize("dt", [0.02, 0.3, 1.5])
def test_long_times_give_the_papers_constant_acceleration(dt):
    long = replace(C, velocity_time_s=1e7, acceleration_time_s=1e7)
    model = singer.discretise(dt, long)
    np.testing.assert_allclose(model.F[:3, :3], motion.transition(dt), rtol=1e-5, atol=1e-6)
    want = motion.process_noise(dt, 1.0)
    np.testing.assert_allclose(model.jerk[:3, :3], want, rtol=1e-5)


@given(first=st.integers(1, 3_000_000), second=st.integers(1, 3_000_000))
def test_two_steps_are_one_long_step(first, second):
    a, b = singer.discretise(first / 1e6, C), singer.discretise(second / 1e6, C)
    both = singer.discretise((first + second) / 1e6, C)
    np.testing.assert_allclose(b.F @ a.F, both.F, rtol=1e-9, atol=1e-12)
    for noise in DRIVEN:
        joined = b.F @ getattr(a, noise) @ b.F.T + getattr(b, noise)
        want = getattr(both, noise)
        np.testing.assert_allclose(joined, want, rtol=1e-8, atol=1e-10 * np.abs(want).max())


def test_a_step_of_a_day_is_finite():
    model = singer.discretise(86_400.0, C)
    assert all(np.isfinite(part).all() for part in model)
    assert model.F[1, 1] == pytest.approx(0.0, abs=1e-12)


def test_no_time_changes_nothing():
    model = singer.discretise(0.0, C)
    np.testing.assert_array_equal(model.F, np.eye(singer.STATES))
    assert not any(part.any() for part in model[1:])


def test_noise_grows_with_size_and_with_perspective():
    q, step = singer.initial_process_noise(C), singer.discretise(0.1, C)
    small, large = singer.process_covariance(np.array([10.0, 20.0]), np.zeros(2), step, q, C)
    assert large[0, 1, 1] == pytest.approx(4.0 * small[0, 1, 1])
    calm, near = singer.process_covariance(np.array([10.0, 10.0]), np.array([0.0, 1.0]), step, q, C)
    assert near[0, 2, 2] / calm[0, 2, 2] == pytest.approx((1.0 + C.perspective_jerk / C.jerk) ** 2)


@pytest.mark.parametrize("growth", [-1.5, -0.2, 0.0, 1e-9, 0.3, 2.0])
def test_constant_velocity_in_space_is_predicted_exactly(growth):
    """A pinhole camera: x = X/Z, size = 1/Z; with nothing that decays the image after a step is exact."""
    c = replace(C, velocity_time_s=1e9, acceleration_time_s=1e9, growth_time_s=1e9)
    dt, Z, X, Y = 0.15, 20.0, 3.0, -1.5
    speed = np.array([0.7, 0.2, -growth * Z])  # dX/dt, dY/dt, dZ/dt: g = -Z'/Z
    mean = np.zeros((1, 2, singer.STATES))
    for axis, place in enumerate((X, Y)):
        velocity = (speed[axis] - place / Z * speed[2]) / Z
        mean[0, axis, : singer.MOTION] = place / Z, velocity, 0.0, np.log(1.0 / Z), growth
    F = singer.in_perspective(singer.discretise(dt, c).F, mean, dt, c)
    got = (F @ mean[..., None])[..., 0]
    later = Z + speed[2] * dt
    for axis, place in enumerate((X, Y)):
        x = (place + speed[axis] * dt) / later
        v = (speed[axis] - x * speed[2]) / later
        want = x, v, 0.0, np.log(1.0 / later), -speed[2] / later
        # Position is integrated with the growth rate of the step's beginning: exact to its third order.
        tolerance = abs(mean[0, axis, 1]) * dt * (growth * dt) ** 2
        assert got[0, axis, 0] == pytest.approx(want[0], abs=tolerance + 1e-9)
        assert got[0, axis, 1] == pytest.approx(want[1], rel=3.0 * (growth * dt) ** 2 + 1e-7)
        np.testing.assert_allclose(got[0, axis, 3 : singer.MOTION], want[3:], rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("dt", STEPS)
def test_errors_that_last_keep_their_variance_and_forget_exponentially(dt):
    size, log_variance = np.array([[100.0, 60.0]]), 2.0 * np.log(0.06)
    position, extent = singer.lasting_error(size, log_variance, C)
    mean, covariance = np.zeros((1, 2, singer.STATES)), np.zeros((1, 2, singer.STATES, singer.STATES))
    mean[..., singer.LOG_SIZE], mean[..., singer.POSITION_ERROR] = np.log(size), 4.0
    covariance[..., singer.POSITION_ERROR, singer.POSITION_ERROR] = position
    covariance[..., singer.SIZE_ERROR, singer.SIZE_ERROR] = extent
    model, q = singer.discretise(dt, C), singer.initial_process_noise(C)
    got, grown = singer.predict(mean, covariance, model, model.F[None, None], q, log_variance, C)
    np.testing.assert_allclose(got[..., singer.POSITION_ERROR], 4.0 * np.exp(-dt / C.error_time_s))
    np.testing.assert_allclose(grown[..., singer.POSITION_ERROR, singer.POSITION_ERROR], position)
    np.testing.assert_allclose(grown[..., singer.SIZE_ERROR, singer.SIZE_ERROR], extent)
    np.testing.assert_array_equal(got[..., singer.POSITION], 0.0)


def test_errors_of_centre_and_size_are_those_of_two_sides():
    """Brute force: two sides that err independently, and what centre and ln size get of it."""
    side = 0.01 * (0.5 * np.sqrt(100.0 * 60.0) + 0.5 * 100.0)
    rng = np.random.default_rng(0)
    left, right = rng.normal(0.0, side, (2, 200_000))
    position, extent = singer.lasting_error(
        np.array([[100.0, 60.0]]), 2.0 * np.log(0.01), replace(C, error_share=1.0)
    )
    assert position[0, 0] == pytest.approx(((left + right) / 2.0).var(), rel=0.02)
    assert extent[0, 0] == pytest.approx(np.log((100.0 + right - left) / 100.0).var(), rel=0.02)


@pytest.mark.parametrize("depth", [8.0, 60.0])
def test_reported_acceleration_is_the_second_derivative_of_the_image(depth):
    """A point X at Ẋ, at depth Z with Ż, has the image x = X/Z: ẍ = −2 Ẋ Ż/Z² + 2 X Ż²/Z³."""
    X, X_dot, Z_dot = np.array([300.0, 900.0]), np.array([40.0, -15.0]), -25.0
    undamped = replace(C, velocity_time_s=1e12)
    mean = np.zeros((1, 2, singer.STATES))
    mean[0, :, singer.POSITION] = X / depth
    mean[0, :, singer.VELOCITY] = X_dot / depth - X * Z_dot / depth**2
    mean[0, :, singer.GROWTH] = -Z_dot / depth
    told = singer.reported_motion(mean, undamped)[0, :, singer.ACCELERATION]
    want = -2.0 * X_dot * Z_dot / depth**2 + 2.0 * X * Z_dot**2 / depth**3
    np.testing.assert_allclose(told, want, rtol=1e-9)


def test_reported_acceleration_is_the_rate_of_the_predicted_velocity():
    mean = np.random.default_rng(3).normal(size=(5, 2, singer.STATES)) * 10.0
    mean[..., singer.GROWTH] *= 0.1
    dt = 1e-5
    F = singer.in_perspective(singer.discretise(dt, C).F, mean, dt, C)
    after = (F @ mean[..., None])[..., 0]
    rate = (after - mean)[..., singer.VELOCITY] / dt
    np.testing.assert_allclose(singer.reported_motion(mean, C)[..., singer.ACCELERATION], rate, rtol=1e-3)


def test_reported_covariance_is_that_of_the_joint_state():
    """J P Jᵀ of both axes at once, with derivatives by differences; the axes are independent."""
    rng = np.random.default_rng(4)
    mean, root = rng.normal(size=(2, singer.STATES)), rng.normal(size=(2, singer.STATES, singer.STATES))
    P = root @ root.transpose(0, 2, 1)
    joint = np.zeros((2 * singer.STATES, 2 * singer.STATES))
    for axis in range(2):
        rows = slice(axis * singer.STATES, (axis + 1) * singer.STATES)
        joint[rows, rows] = P[axis]

    def of_object(flat):  # without what lasts of the errors, which the variances are not of
        state = flat.reshape(2, singer.STATES).copy()
        state[:, singer.MOTION :] = 0.0
        return singer.reported_motion(state, C)

    h = 1e-6
    steps = np.eye(2 * singer.STATES) * h
    J = np.stack([(of_object(mean.ravel() + s) - of_object(mean.ravel() - s)) / (2.0 * h) for s in steps], -1)
    got = singer.reported_covariance(mean, P, C)
    for axis in range(2):
        np.testing.assert_allclose(got[axis], J[axis] @ joint @ J[axis].T, rtol=1e-6, atol=1e-6)
