"""Which constants are moved, and how."""

from __future__ import annotations

import math
from dataclasses import asdict, fields

import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.constant_moves import PROBABILITIES, TECHNICAL, Move, scattered, single_moves, times, varied
from jeat_graph.filters.model_constants import ModelConstants

SHIPPED = ModelConstants()


def test_every_single_number_is_moved_or_named_as_technical():
    floats = {f.name for f in fields(ModelConstants) if isinstance(getattr(SHIPPED, f.name), float)}
    assert set(varied()) | set(TECHNICAL) == floats
    assert not set(varied()) & set(TECHNICAL)
    assert set(varied()) >= PROBABILITIES


def test_probabilities_lie_between_0_and_1_and_no_other_constant_leaves_what_it_may_be():
    for name in varied():
        value = getattr(SHIPPED, name)
        assert value > 0.0, name
        assert value < 1.0 or name not in PROBABILITIES, name


def test_a_factor_of_a_probability_is_that_of_its_odds():
    assert times("p_detect", 0.75, 2.0) == pytest.approx(6.0 / 7.0)  # odds 3 to 1, then 6 to 1
    assert times("jerk", 0.75, 2.0) == 1.5


@given(st.sampled_from(sorted(PROBABILITIES)), st.floats(0.01, 100.0), st.floats(0.001, 0.999))
def test_odds_multiply_and_stay_odds(name, factor, value):
    moved = times(name, value, factor)
    assert 0.0 < moved < 1.0
    assert math.log(moved / (1.0 - moved)) == pytest.approx(
        math.log(value / (1.0 - value)) + math.log(factor), abs=1e-6
    )


def test_a_move_changes_one_constant():
    moved = asdict(Move("jerk", 1.4)(SHIPPED))
    assert moved == asdict(SHIPPED) | {"jerk": pytest.approx(1.4 * SHIPPED.jerk)}
    assert str(Move("jerk", 1.4)) == "jerk × 1.4"
    assert len(single_moves(["jerk", "cut_gate"], [0.7, 1.4])) == 4


def test_random_points_lie_within_their_spread_and_a_factor_hangs_on_name_and_seed_alone():
    names = varied()
    factors = []
    for seed in range(20):
        point = scattered(SHIPPED, names, 2.0, seed)
        assert point == scattered(SHIPPED, names, 2.0, seed)
        assert point.jerk == scattered(SHIPPED, ["jerk"], 2.0, seed).jerk
        factors += [
            getattr(point, name) / getattr(SHIPPED, name) for name in names if name not in PROBABILITIES
        ]
    logs = [math.log2(one) for one in factors]
    assert max(map(abs, logs)) <= 1.0
    # Even in (−1, 1): mean 0 and variance 1/3, within four standard errors.
    assert abs(sum(logs) / len(logs)) < 4.0 * math.sqrt(1.0 / 3.0 / len(logs))
    variance = sum(one**2 for one in logs) / len(logs)
    assert abs(variance - 1.0 / 3.0) < 4.0 * math.sqrt((1.0 / 5.0 - 1.0 / 9.0) / len(logs))
