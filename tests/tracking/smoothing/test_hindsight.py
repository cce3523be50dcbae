"""Existence in hindsight: forward-backward smoothing against the sum over all histories of a short life."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.config.reading import load_config
from jeat_graph.smoothers.measurements import measurements
from jeat_graph.tracking.smoothing.history import TrackHistory
from jeat_graph.tracking.smoothing.observation_times import BELIEVED, RETURNS, ObservationTimes
from jeat_graph.tracking.smoothing.priors import ErrorStates

LIFETIME_S = 5.0

probabilities = st.lists(st.floats(0.01, 0.99), min_size=1, max_size=7)


def looks_of(existence, t=None):
    n = len(existence)
    times = np.arange(n) * 0.3 if t is None else np.array(t)
    return ObservationTimes(
        times,
        np.array(existence, dtype=float),
        np.ones(n),
        np.zeros(n, dtype=np.int64),
        np.zeros(n, dtype=bool),
        np.ones((n, 2)),
    )


def logit(p):
    return math.log(p / (1.0 - p))


def by_enumeration(existence, t, known):
    """Sum over all sequences of present and absent, each look weighed by what it did to the causal odds."""
    n = len(existence)
    ratio = [existence[0] / (1.0 - existence[0])]
    for k in range(1, n):
        stay = math.exp(-(t[k] - t[k - 1]) / LIFETIME_S)
        before = existence[k - 1] * stay
        ratio.append(math.exp(logit(existence[k]) - logit(before)))
    gone = np.maximum.accumulate(existence) >= BELIEVED
    total, present = 0.0, np.zeros(n)
    for states in itertools.product((False, True), repeat=n):
        weight = ratio[0] if states[0] else 1.0
        for k in range(1, n):
            end = -math.expm1(-(t[k] - t[k - 1]) / LIFETIME_S)
            begin = end * (RETURNS if known or gone[k - 1] else 1.0)
            if states[k - 1]:
                weight *= 1.0 - end if states[k] else end
            else:
                weight *= begin if states[k] else 1.0 - begin
            weight *= ratio[k] if states[k] else 1.0
        total += weight
        present += weight * np.array(states)
    return present / total


@given(probabilities, st.booleans())
def test_it_is_the_sum_over_all_histories_but_for_what_came_before(existence, known):
    looks = looks_of(existence)
    exact = by_enumeration(existence, looks.t, known)
    found = looks.hindsight(LIFETIME_S, known)
    # The past enters through the causal estimate, which knows no return; so only the first step is exact.
    assert found[0] == pytest.approx(exact[0], abs=1e-9)
    assert np.all((found >= 0.0) & (found <= 1.0))


@given(probabilities)
def test_the_last_step_knows_no_more_than_the_filter(existence):
    assert looks_of(existence).hindsight(LIFETIME_S)[-1] == pytest.approx(existence[-1], abs=1e-9)


def test_what_is_certain_later_has_been_there_before_unless_it_was_doubted():
    rising = looks_of([0.2, 0.6, 0.9, 0.99, 0.9999]).hindsight(LIFETIME_S)
    assert np.all(rising > looks_of([0.2, 0.6, 0.9, 0.99, 0.9999]).existence - 1e-9)
    assert rising[0] > 0.5


def test_the_end_of_a_track_that_fades_is_no_vehicle():
    fading = looks_of([0.99, 0.9, 0.3, 0.05, 0.01]).hindsight(LIFETIME_S)
    assert fading[0] < 0.99
    assert np.all(np.diff(fading) <= 0.0)


def test_between_two_fragments_it_is_there_as_at_their_ends():
    values = looks_of([0.9, np.nan, np.nan, 0.6]).hindsight(LIFETIME_S)
    assert values[1] == values[2] == min(values[0], values[3])


@pytest.mark.parametrize(("worth", "expected"), [(0.5, [0.45, 0.8, 0.9]), (1.0, [0.9, 0.9, 0.9])])
def test_what_stays_in_place_is_believed_for_its_looks_or_for_what_had_been_seen_by_then(worth, expected):
    """The worth of the last detection counts: after it there are only misses."""
    looks = ObservationTimes(
        np.arange(3) * 0.1,
        np.array([0.2, 0.8, 0.95]),
        np.array([0.1, worth, 0.3]),
        np.array([1, 1, 0]),
        np.zeros(3, dtype=bool),
        np.ones((3, 2)),
    )
    assert looks.when_last_seen() == (0.8, worth)
    assert looks.in_place(np.full(3, 0.9)) == pytest.approx(expected)


@pytest.mark.parametrize(("velocity", "first"), [(0.0, 0.6), (200.0, 0.1)])
def test_only_what_moves_has_rows_from_before_it_was_believed_in(velocity, first):
    """Causal log odds rise by .9 a step from -4 on: .62 after .5 s, .80 after .6 s."""
    t = np.arange(20) * 0.1
    rows = measurements(
        t,
        np.column_stack([300.0 + velocity * t, np.full(20, 200.0)]),
        np.full((20, 2), 4.0),
        np.full(20, 9.0),
    )
    rows["velocity_var"], rows["acceleration_var"], rows["rate_var"] = 100.0**2, 100.0**2, 0.1
    rows["log_size"], rows["size_var"] = 4.0, 0.01
    config = load_config("default", ["sensors.one={rate_hz: 10}", "smoother.engine=rts"])
    history = TrackHistory(1, config, ErrorStates.of(config), keep=True)
    history.add_measurements(rows)
    seen = np.ones(20, dtype=np.int64)
    rising = 1.0 / (1.0 + np.exp(4.0 - 0.9 * np.arange(20)))
    looks = ObservationTimes(t, rising, np.full(20, 0.6), seen, np.zeros(20, dtype=bool), np.ones((20, 2)))
    history.add_steps(looks, True)
    history.feed()
    (table,) = history.finish()
    assert table.t[0] == pytest.approx(first, abs=1e-9)
