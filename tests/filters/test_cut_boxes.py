"""Boxes at the edge of the picture measure the sides that show."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.filters.cut_boxes import (
    BOTH_CUT,
    HIGH_CUT,
    LEAST_KNOWN_LOG_STD,
    LOW_CUT,
    WHOLE,
    bound_unmeasured,
    centre_from_side,
    cut_of,
    floor_of_centre,
)


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (10.0, 50.0, WHOLE),
        (0.0, 50.0, LOW_CUT),
        (2.9, 50.0, LOW_CUT),
        (-2.0, 50.0, LOW_CUT),
        (600.0, 638.0, HIGH_CUT),
        (1.0, 640.0, BOTH_CUT),
        (-20.0, 50.0, WHOLE),  # a detector that guesses what does not show
        (600.0, 680.0, WHOLE),
    ],
)
def test_a_box_is_cut_where_a_side_lies_at_the_edge(low, high, expected):
    assert cut_of(low, high, 640.0, 3.0) == expected


def test_without_a_width_of_the_edge_all_boxes_are_whole():
    assert cut_of(0.0, 640.0, 640.0, 0.0) == WHOLE


@given(
    centre=st.floats(-100.0, 100.0), log_size=st.floats(0.0, 6.0), cut=st.sampled_from([LOW_CUT, HIGH_CUT])
)
def test_with_the_true_size_the_side_gives_the_true_centre(cut, centre, log_size):
    half = 0.5 * np.exp(log_size)
    side = centre + half if cut == LOW_CUT else centre - half
    found, var = centre_from_side(cut, side, log_size, 0.0)
    assert found == pytest.approx(centre, abs=1e-9)
    assert var == 0.0


def test_the_variance_of_the_size_becomes_one_of_the_centre():
    rng = np.random.default_rng(0)
    std = 0.05
    sizes = np.exp(np.log(80.0) + rng.normal(0.0, std, 100_000))
    _, var = centre_from_side(LOW_CUT, 120.0, np.log(80.0), std**2)
    # To first order in the error of ln size: a twentieth of it squared is the next term.
    assert var == pytest.approx(np.var(120.0 - 0.5 * sizes), rel=0.02)


@pytest.mark.parametrize("cut", [LOW_CUT, HIGH_CUT])
def test_a_centre_is_never_known_better_than_the_size_allows(cut):
    P = np.diag([1.0, 2.0, 3.0])
    floor_of_centre(cut, np.log(80.0), 0.01, P)
    assert P[0, 0] == pytest.approx(40.0**2 * 0.01)
    assert np.diag(P)[1:].tolist() == [2.0, 3.0]


@pytest.mark.parametrize("cut", [WHOLE, BOTH_CUT])
def test_other_boxes_leave_the_covariance_alone(cut):
    P = np.diag([1.0, 2.0, 3.0])
    floor_of_centre(cut, np.log(80.0), 0.01, P)
    assert np.array_equal(P, np.diag([1.0, 2.0, 3.0]))


def test_a_size_that_is_not_measured_is_no_less_known_than_that_of_any_vehicle():
    P = np.array([[9.0, 3.0], [3.0, 4.0]])
    correlation = P[0, 1] / np.sqrt(P[0, 0] * P[1, 1])
    bound_unmeasured(P)
    assert np.diag(P) == pytest.approx([LEAST_KNOWN_LOG_STD**2, 4.0])
    assert P[0, 1] == P[1, 0] == pytest.approx(correlation * LEAST_KNOWN_LOG_STD * 2.0)
    known = np.array([[0.01, 0.002], [0.002, 0.04]])
    kept = known.copy()
    bound_unmeasured(kept)
    assert np.array_equal(kept, known)
