"""Who is believed where sensors disagree: the parts against closed forms and against detectors made up."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.filters.agreement import (
    high_as_often,
    score_persistence,
    score_variety,
    share_of_kind,
    trust_alone,
    trust_in,
    trust_of_best,
    trust_on_balance,
)

SHARE = st.floats(0.0, 1.0)


def deviations(between, within, tracks=400, length=20, seed=1):
    """Sums of products and of squares where tracks differ by `between` and scores of one by `within`."""
    rng = np.random.default_rng(seed)
    odds = rng.normal(0.0, between, (tracks, 1)) + rng.normal(0.0, within, (tracks, length))
    before = (np.cumsum(odds, axis=1) / np.arange(1, length + 1))[:, 3:-1]
    return (before * odds[:, 4:]).sum(), (before**2).sum()


def test_scores_that_are_the_tracks_own_come_again():
    assert score_persistence(*deviations(1.0, 0.1)) == pytest.approx(1.0, abs=0.02)


def test_scores_thrown_like_dice_do_not():
    assert score_persistence(*deviations(0.0, 1.0)) == pytest.approx(0.0, abs=0.05)


def test_between_the_two_it_is_the_slope_of_regression():
    """Of one score on the mean of n before: b² / (b² + w² / n), where n runs from 4 to 19."""
    counts = np.arange(4, 20)
    expected = 1.0 / np.mean(1.0 + 1.0 / counts)
    assert score_persistence(*deviations(1.0, 1.0)) == pytest.approx(expected, abs=0.05)


def test_where_all_scores_are_the_same_they_tell_nothing():
    assert score_persistence(0.0, 0.0) == 0.0
    assert score_variety(0.0, 100.0) == 0.0


@pytest.mark.parametrize("high", [0.2, 0.5, 0.9])
def test_of_one_kind_as_many_score_high(high):
    assert high_as_often(high * 1e4, 1e4, high * 300.0, 300.0) == pytest.approx(1.0, rel=1e-4)


def test_what_scores_lower_is_of_another_kind():
    assert high_as_often(0.0, 50.0, 20.0, 50.0) == 0.0
    assert share_of_kind(0.0, 1.0, 1.0, 1.0) == share_of_kind(0.5, 1.0, 1.0, 1.0) == 0.0


@pytest.mark.parametrize("faded", [0.0, 5e-324])
def test_where_nothing_was_agreed_on_no_kind_is_known(faded):
    assert high_as_often(5.0, 0.0, faded, faded) == 0.0


@given(SHARE, SHARE, SHARE, SHARE)
def test_the_share_of_a_kind_is_a_share_and_grows_with_how_often_it_scores_high(often, own, variety, worth):
    lower, upper = (share_of_kind(x, own, variety, worth) for x in (0.5 * often, often))
    assert 0.0 <= lower <= upper <= worth


@given(st.floats(0.0, 100.0), SHARE, st.floats(0.0, 12.0))
def test_trust_is_the_share_borne_out_to_a_power(claims, share, power):
    expected = ((share * claims + 5.0 * 0.9) / (claims + 5.0)) ** power
    assert trust_in(share * claims, claims, 0.9, 5.0, power) == pytest.approx(expected)


def test_a_sensor_alone_is_believed_between_not_at_all_better_and_in_full():
    assert trust_alone(0.0, 0.02, 0.3) == 1.0
    assert trust_alone(0.01, 0.02, 0.3) == pytest.approx(np.sqrt(0.3))
    assert trust_alone(0.02, 0.02, 0.3) == trust_alone(0.9, 0.02, 0.3) == 0.3


@given(st.floats(0.01, 1.0), st.floats(0.1, 100.0), st.floats(0.0, 1.0))
def test_hits_bring_a_vehicle_twice_what_misses_take_unless_they_are_believed_in_full(trust, gained, share):
    factor = trust_on_balance(trust, gained, share * gained)
    assert trust <= factor <= 1.0
    assert factor == 1.0 or factor * gained >= 2.0 * share * gained * (1.0 - 1e-12)
    # Where that is so anyhow, nothing changes.
    assert factor == trust or factor <= 2.0 * share * (1.0 + 1e-12)


def test_before_the_first_hit_nothing_is_known_of_misses():
    assert trust_on_balance(0.3, 0.0, 0.0) == trust_on_balance(0.3, 0.0, 2.0) == 0.3


@given(st.floats(1e-6, 1.0), st.floats(0.01, 1.0), st.floats(0.1, 100.0), st.floats(0.0, 1.0))
def test_the_best_is_believed_as_if_alone_but_no_more_than_an_unknown_one(trust, unknown, gained, share):
    alone = trust_on_balance(trust, gained, share * gained)
    expected = max(trust, min(alone, unknown))
    assert trust_of_best(trust, trust, unknown, gained, share * gained) == pytest.approx(expected)


@given(st.floats(1e-6, 1.0), SHARE, st.floats(0.1, 100.0), st.floats(0.0, 1.0))
def test_another_is_lifted_by_no_more_than_its_part_of_the_best(best, part, gained, share):
    factor = trust_of_best(part * best, best, 0.3, gained, share * gained)
    assert part * best <= factor <= max(0.3 * part, part * best) * (1.0 + 1e-12)


def test_where_nothing_is_left_of_any_trust_there_is_none():
    assert trust_of_best(0.0, 0.0, 0.3, 1.0, 1.0) == 0.0
