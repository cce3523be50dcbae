"""Measurement noise: by size, by score, and adapted by the innovations (paper eq. 5)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.filters.noise import adapt_scale, base_variance, hidden_excess, score_weight

PAPER = (0.1, 0.5, 5.0)


@given(sigma=st.floats(0.0, 50.0), rho=st.floats(0.0, 1.0), side=st.floats(0.0, 2000.0))
def test_base_variance_grows_with_the_square_of_the_side(sigma, rho, side):
    assert base_variance(sigma, rho, side, 0.0, 1e6) == pytest.approx(sigma**2 + (rho * side) ** 2)


@given(rho=st.floats(0.0, 1.0), size=st.floats(0.0, 2000.0))
def test_a_part_of_it_goes_with_the_whole_box(rho, size):
    assert base_variance(2.0, 0.0, 10.0, rho, size) == pytest.approx(4.0 + (rho * size) ** 2)


@pytest.mark.parametrize(
    ("score", "weight"), [(1.0, 1.0), (0.5, 2.0), (0.1, 10.0), (0.05, 10.0), (0.0, 10.0)]
)
def test_a_doubtful_detection_has_more_noise_down_to_the_floor(score, weight):
    assert score_weight(score, 0.1) == pytest.approx(weight)


@given(scale=st.floats(0.5, 5.0), nis=st.floats(0.0, 1e6))
def test_adaptation_is_equation_5(scale, nis):
    expected = max(0.5, min(scale * (1.0 + 0.1 * (nis / 2.0 - 1.0)), 5.0))
    # Five operations, of which one takes a tenth from one: fewer than ten roundings.
    assert adapt_scale(scale, nis, *PAPER) == pytest.approx(expected, rel=10 * np.finfo(np.float64).eps)


@pytest.mark.parametrize(
    ("scale", "nis", "after"),
    [
        (1.0, 2.0, 1.0),  # as expected: no change
        (1.0, 0.0, 0.9),
        (1.0, 4.0, 1.1),
        (0.5, 0.0, 0.5),  # clamped below
        (5.0, 9.2, 5.0),  # clamped above
        (0.6, 1e300, 5.0),
    ],
)
def test_adaptation_by_hand(scale, nis, after):
    assert adapt_scale(scale, nis, *PAPER) == pytest.approx(after)


@given(
    white=st.floats(0.01, 100.0),
    coloured=st.floats(0.0, 10.0),
    hidden=st.floats(0.0, 1.0),
    growth=st.floats(0.0, 5.0),
)
def test_the_error_of_a_box_grows_with_the_part_that_others_hide(white, coloured, hidden, growth):
    assert hidden_excess(0.0, growth) == hidden_excess(hidden, 0.0) == 0.0
    whole = white + coloured**2
    # What is added is white, so that the whole standard deviation grows by that factor.
    std = np.sqrt(white + hidden_excess(hidden, growth) * whole + coloured**2)
    assert std == pytest.approx(np.sqrt(whole) * (1.0 + growth * hidden))
