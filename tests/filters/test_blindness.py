"""A sensor that is blind as a whole: the chain against Bayes' rule over all its paths."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jeat_graph.filters.blindness import (
    blind_after_scan,
    blind_before_scan,
    ratio_of_hit,
    ratio_of_leftover,
    ratio_of_miss,
)
from jeat_graph.filters.existence import existence_after_miss

PROBABILITY = st.floats(0.01, 0.99)


def by_all_paths(found, p_detect, first, sight_scans, blind_scans):
    """P(blind) after scans of `n` vehicles, of which `found[k]` are found: summed over all 2^K paths."""
    move = np.array([[1 - 1 / sight_scans, 1 / sight_scans], [1 / blind_scans, 1 - 1 / blind_scans]])
    total = np.zeros(2)
    for path in itertools.product((0, 1), repeat=len(found) + 1):
        p = (1 - first, first)[path[0]]
        for k, hits in enumerate(found):
            now = path[k + 1]
            p *= move[path[k], now]
            for hit in hits:
                seen = (1.0 - now) * p_detect
                p *= seen if hit else 1.0 - seen
        total[path[-1]] += p
    return total[1] / total.sum()


@settings(max_examples=40)
@given(
    st.lists(st.lists(st.just(False), min_size=0, max_size=4), min_size=1, max_size=5),
    PROBABILITY,
    st.floats(0.01, 0.9),
    st.floats(2.0, 1e4),
    st.floats(2.0, 1e4),
)
def test_empty_scans_are_judged_by_bayes_rule_over_all_paths(found, p_detect, first, sight, dark):
    blind = first
    for hits in found:
        ratio = sum(ratio_of_miss(1.0, p_detect) for _ in hits)
        blind = blind_after_scan(blind_before_scan(blind, sight, dark), ratio)
    expected = by_all_paths(found, p_detect, first, sight, dark)
    assert blind == pytest.approx(expected, abs=1e-5)


@given(PROBABILITY, PROBABILITY, PROBABILITY)
def test_existence_after_a_miss_is_that_of_the_joint_of_vehicle_and_sensor(existence, p_detect, blind):
    """Four cases: there or not, seeing or blind; what remains of them where nothing was found."""
    missed = {
        (there, dark): (existence if there else 1 - existence)
        * (blind if dark else 1 - blind)
        * (1 - p_detect if there and not dark else 1.0)
        for there in (0, 1)
        for dark in (0, 1)
    }
    whole = sum(missed.values())
    after = blind_after_scan(blind, ratio_of_miss(existence, p_detect))
    assert after == pytest.approx((missed[0, 1] + missed[1, 1]) / whole, rel=1e-6)
    left = existence_after_miss(existence, p_detect, after)
    assert left == pytest.approx((missed[1, 0] + missed[1, 1]) / whole, rel=1e-6)
    # The same by a miss that counts only as far as the sensor is believed to see.
    seen = p_detect * (1.0 - blind)
    assert left == pytest.approx(existence_after_miss(existence, seen), rel=1e-6)


@given(PROBABILITY, PROBABILITY, st.floats(-50.0, 50.0))
def test_a_hit_weighs_what_it_is_worth_against_clutter(existence, p_detect, evidence):
    """Under "blind" the detection is clutter; under "sees" it is that or the track's."""
    sees = 1.0 - existence * p_detect + existence * math.exp(min(evidence, 30.0))
    assert ratio_of_hit(existence, p_detect, evidence) == pytest.approx(-math.log(max(sees, 1e-6)), rel=1e-9)


def test_leftovers_that_may_be_vehicles_speak_for_sight_and_clutter_says_nothing():
    assert ratio_of_leftover(0.0) == 0.0
    assert ratio_of_leftover(0.75) == pytest.approx(math.log(0.25))
    assert math.isfinite(ratio_of_leftover(1.0))


def test_with_nothing_to_find_the_chain_goes_to_its_share_of_the_time():
    blind = 0.9
    for _ in range(5000):
        blind = blind_after_scan(blind_before_scan(blind, 300.0, 100.0), 0.0)
    assert blind == pytest.approx(100.0 / 400.0, abs=1e-9)


@given(st.floats(0.0, 1.0), st.floats(-1e6, 1e6))
def test_neither_state_is_ever_certain(blind, ratio):
    assert 0.0 < blind_after_scan(blind, ratio) < 1.0
