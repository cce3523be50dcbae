"""Constant acceleration with white jerk, and the model of sizes, for any time step."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad_vec
from scipy.linalg import expm

from jeat_graph.filters.motion import process_noise, size_process_noise, size_transition, transition

STEPS = [0.0, 1e-4, 0.01, 0.05, 1.0, 7.5]


def van_loan(A, L, density, dt):
    """F and Q of ẋ = A x + L w by the matrix exponential of Van Loan (1978)."""
    n = len(A)
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[:n, n:], block[n:, n:] = -A, density**2 * np.outer(L, L), A.T
    exponential = expm(block * dt)
    F = exponential[n:, n:].T
    return F, F @ exponential[:n, n:]


@pytest.mark.parametrize("dt", STEPS)
def test_transition_moves_by_the_closed_form_of_constant_acceleration(dt):
    p, v, a = 12.0, -30.0, 4.0
    assert np.allclose(transition(dt) @ [p, v, a], [p + v * dt + a * dt**2 / 2, v + a * dt, a], rtol=1e-15)


@pytest.mark.parametrize("dt", STEPS)
def test_motion_model_is_the_exact_discretisation_of_white_jerk(dt):
    A = np.diag([1.0, 1.0], k=1)
    F, Q = van_loan(A, np.array([0.0, 0.0, 1.0]), 3.0, dt)
    assert np.allclose(transition(dt), F, rtol=1e-12, atol=1e-14)
    assert np.allclose(process_noise(dt, 3.0), Q, rtol=1e-9, atol=1e-14)


@pytest.mark.parametrize("dt", [0.01, 0.3, 2.0])
def test_process_noise_is_the_integral_of_what_each_moment_adds(dt):
    def added(s):
        column = np.array([(dt - s) ** 2 / 2, dt - s, 1.0])
        return np.outer(column, column)

    integral, _ = quad_vec(added, 0.0, dt, epsrel=1e-12)
    assert np.allclose(process_noise(dt, 2.5), 2.5**2 * integral, rtol=1e-10, atol=0.0)


@pytest.mark.parametrize("dt", STEPS)
def test_size_model_is_the_exact_discretisation_of_a_driven_rate(dt):
    F, Q = van_loan(np.diag([1.0], k=1), np.array([0.0, 1.0]), 0.7, dt)
    assert np.allclose(size_transition(dt), F, rtol=1e-12)
    assert np.allclose(size_process_noise(dt, 0.7), Q, rtol=1e-10, atol=1e-15)


@given(a=st.floats(0.0, 10.0), b=st.floats(0.0, 10.0))
def test_two_steps_are_one_long_step(a, b):
    assert np.allclose(transition(b) @ transition(a), transition(a + b), rtol=1e-12, atol=1e-12)
    two = transition(b) @ process_noise(a, 2.0) @ transition(b).T + process_noise(b, 2.0)
    assert np.allclose(two, process_noise(a + b, 2.0), rtol=1e-9, atol=1e-30)
    two = size_transition(b) @ size_process_noise(a, 2.0) @ size_transition(b).T + size_process_noise(b, 2.0)
    assert np.allclose(two, size_process_noise(a + b, 2.0), rtol=1e-9, atol=1e-30)


@given(dt=st.floats(1e-6, 100.0), jerk=st.floats(1e-3, 1e4))
def test_process_noise_is_symmetric_positive_definite(dt, jerk):
    Q = process_noise(dt, jerk)
    assert np.array_equal(Q, Q.T)
    # In units of the step the matrix is well conditioned, so that its eigenvalues can be trusted.
    unit = np.diag([dt**-2.5, dt**-1.5, dt**-0.5]) / jerk
    assert np.linalg.eigvalsh(unit @ Q @ unit).min() > 1e-4
