"""A wrong time is refused where it would be gone through in steps."""

from __future__ import annotations

import math

import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.data.steps import MOST_STEPS, check_steps


def test_as_many_steps_as_are_allowed_and_one_more():
    check_steps(10.0, 10.0 + MOST_STEPS, 1.0, "rows")
    with pytest.raises(DataError, match=r"from 10 to 10000011 s are 2777\.78 h.* rows, more than 10000000"):
        check_steps(10.0, 10.0 + MOST_STEPS + 1, 1.0, "rows")


@pytest.mark.parametrize("end", [1e18, math.inf, math.nan])
def test_no_time_is_too_far_for_a_clear_error(end):
    with pytest.raises(DataError, match="wrong"):
        check_steps(0.0, end, 20.0, "frames", "choose less")
