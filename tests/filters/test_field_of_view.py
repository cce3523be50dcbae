"""The part of the picture that a sensor looks at, against the posterior it is said to be."""

import numpy as np
import pytest
from scipy.integrate import quad

from jeat_graph.filters.field_of_view import extend_field, in_field

NOTHING = np.array([np.inf, -np.inf])


def field_of(*boxes):
    field = NOTHING.copy()
    for box in boxes:
        extend_field(np.array(box, float), field)
    return field


def test_the_field_reaches_over_all_boxes():
    field = field_of((100, 50, 20, 10), (300, 20, 40, 60), (150, 30, 5, 5))
    np.testing.assert_array_equal(field, [100, 340])


@pytest.mark.parametrize(("beyond", "seen"), [(10.0, 1), (40.0, 3), (200.0, 8)])
def test_beyond_the_boxes_it_is_the_posterior_of_the_end_of_a_uniform_distribution(beyond, seen):
    """Samples of U(0, b), the greatest of them w, and the prior 1 / b² on b: P(b > w + d) by quadrature."""
    width = 150.0

    def posterior(b):
        return b**-2 * (width / b) ** seen

    tail, whole = (quad(posterior, start, np.inf, epsabs=0.0)[0] for start in (width + beyond, width))
    expected = tail / whole
    field = field_of((100, 100, width, 80))
    assert in_field(250.0 + beyond, *field, seen) == pytest.approx(expected, rel=1e-7)
    assert in_field(100.0 - beyond, *field, seen) == pytest.approx(expected, rel=1e-7)


def test_inside_it_is_certain_and_more_boxes_tell_more_of_what_is_outside():
    field = field_of((100, 100, 50, 80))
    assert in_field(100.0, *field, 4.0) == in_field(150.0, *field, 400.0) == 1.0
    assert (
        0.5 > in_field(170.0, *field, 2.0) > in_field(170.0, *field, 4.0) > in_field(200.0, *field, 4.0) > 0.0
    )


def test_of_a_sensor_that_has_shown_nothing_all_is_taken_to_be_seen():
    assert in_field(500.0, *NOTHING, 0.0) == 1.0
