"""Variances that are not true cost a configuration something."""

import math

import pytest

from jeat_graph.calibration.consistency_penalty import CONSISTENT, consistency_penalty


def test_within_the_bounds_nothing_is_charged_and_outside_by_the_logarithm():
    low, high = CONSISTENT
    assert [consistency_penalty(a) for a in (low, 1.0, high, math.nan)] == [0.0] * 4
    assert consistency_penalty(high * math.e) == pytest.approx(consistency_penalty(low / math.e))
    assert consistency_penalty(high * math.e**2) == pytest.approx(2.0 * consistency_penalty(high * math.e))
