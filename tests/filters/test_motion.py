"""Constant acceleration with white jerk, for any time step."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad_vec
from scipy.linalg import expm, expm_cond

from jeat_graph.filters.motion import process_noise, transition

STEPS = [1e-4, 0.01, 0.05, 1.0, 7.5]
EPS = np.finfo(np.float64).eps


def van_loan(A, L):
    """F and Q of ẋ = A x + L w over one unit of time, by the matrix exponential of Van Loan (1978); a bound.

    The bound is what rounding may do to an entry of them: the relative condition of the exponential (Higham,
    Functions of Matrices, 2008, ch. 3) times its norm, some ten roundings, and once more for the product.
    """
    n = len(A)
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[:n, n:], block[n:, n:] = -A, np.outer(L, L), A.T
    exponential = expm(block)
    F, norm = exponential[n:, n:].T, np.linalg.norm(exponential)
    bound = 10 * EPS * expm_cond(block) * norm * np.linalg.norm(F)
    return F, F @ exponential[:n, n:], bound


@pytest.mark.parametrize("dt", [0.0, *STEPS])
def test_transition_moves_by_the_closed_form_of_constant_acceleration(dt):
    p, v, a = 12.0, -30.0, 4.0
    moved = transition(dt) @ [p, v, a]
    # The terms of a sum may cancel: each sum is right to some roundings of its largest term.
    bound = 4 * EPS * np.array([p + abs(v) * dt + a * dt**2 / 2, abs(v) + a * dt, a])
    assert np.all(np.abs(moved - [p + v * dt + a * dt**2 / 2, v + a * dt, a]) <= bound)


def test_no_time_moves_nothing_and_adds_no_noise():
    assert np.array_equal(transition(0.0), np.eye(3))
    assert not process_noise(0.0, 3.0).any()


# In units of the step (px, px per step, px per step²) every step is the same well-conditioned problem, and
# the bound holds for each entry; in px and s the entries lie orders apart, and no one tolerance fits all.


@pytest.mark.parametrize("dt", STEPS)
def test_motion_model_is_the_exact_discretisation_of_white_jerk(dt):
    F, Q, bound = van_loan(np.diag([1.0, 1.0], k=1), np.array([0.0, 0.0, 1.0]))
    unit = np.array([1.0, dt, dt**2])
    assert np.abs(unit[:, None] * transition(dt) / unit - F).max() < bound
    assert np.abs(np.outer(unit, unit) * process_noise(dt, 3.0) / (3.0**2 * dt**5) - Q).max() < bound
    assert bound < 1e-12, "a wrong digit is seen"


@pytest.mark.parametrize("dt", [0.01, 0.3, 2.0])
def test_process_noise_is_the_integral_of_what_each_moment_adds(dt):
    def added(s):
        column = np.array([(dt - s) ** 2 / 2, dt - s, 1.0])
        return np.outer(column, column)

    integral, _ = quad_vec(added, 0.0, dt, epsrel=1e-12)
    # Gauss-Kronrod is exact for polynomials: what is left is rounding, of sums without cancellation.
    assert np.allclose(process_noise(dt, 2.5), 2.5**2 * integral, rtol=1e-12, atol=0.0)


@given(a=st.floats(0.0, 10.0), b=st.floats(0.0, 10.0))
def test_two_steps_are_one_long_step(a, b):
    # All terms are positive: nothing cancels, and each entry is right to some roundings (1e-12 is 4,500).
    assert np.allclose(transition(b) @ transition(a), transition(a + b), rtol=1e-12, atol=1e-30)
    two = transition(b) @ process_noise(a, 2.0) @ transition(b).T + process_noise(b, 2.0)
    assert np.allclose(two, process_noise(a + b, 2.0), rtol=1e-12, atol=1e-30)


@given(dt=st.floats(1e-6, 100.0), jerk=st.floats(1e-3, 1e4))
def test_process_noise_is_symmetric_positive_definite(dt, jerk):
    Q = process_noise(dt, jerk)
    assert np.array_equal(Q, Q.T)
    # In units of the step the matrix is well conditioned, so that its eigenvalues can be trusted.
    unit = np.diag([dt**-2.5, dt**-1.5, dt**-0.5]) / jerk
    assert np.linalg.eigvalsh(unit @ Q @ unit).min() > 1e-4
