"""Vehicles that cross a line."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.eval.counting import Line, count, count_interval, crossings


def table(paths, std=1.0, existence=1.0):
    """Tracks with ids 1, 2, … along the given centres, a row a tenth of a second."""
    t = np.concatenate([0.1 * np.arange(len(p)) for p in paths])
    xy = np.concatenate([np.asarray(p, dtype=float) for p in paths])
    ids = np.repeat(np.arange(1, len(paths) + 1), [len(p) for p in paths])
    mean, var = np.zeros((len(t), 6)), np.full((len(t), 6), std**2)
    mean[:, :2] = xy
    boxes = np.column_stack([xy - 5.0, np.full((len(t), 2), 10.0)])
    return Trajectories(
        t, ids, boxes, np.full(len(t), existence), mean, var, np.zeros(len(t), dtype=np.int64)
    )


ACROSS = Line(0.0, 50.0, 100.0, 50.0, "gate")  # from left to right: its right-hand side is below


def test_a_vehicle_that_drives_down_the_picture_crosses_to_the_right():
    (one,) = crossings(table([[(30.0, y) for y in range(0, 101, 20)]]), ACROSS)
    assert (one.track_id, one.direction) == (1, "right")
    assert one.t == pytest.approx(0.25)
    assert one.probability == pytest.approx(1.0)


def test_the_way_back_is_the_other_direction():
    (one,) = crossings(table([[(30.0, y) for y in range(100, -1, -20)]]), ACROSS)
    assert one.direction == "left"


def test_a_path_past_the_end_of_the_line_does_not_cross_it():
    assert crossings(table([[(130.0, y) for y in range(0, 101, 20)]]), ACROSS) == []


def test_who_turns_back_is_not_counted_and_who_wavers_counts_once():
    there_and_back = [(30.0, y) for y in (0, 40, 60, 40, 0)]
    wavering = [(30.0, y) for y in (0, 45, 55, 45, 55, 45, 55, 100)]
    found = crossings(table([there_and_back, wavering]), ACROSS)
    assert [(c.track_id, c.direction) for c in found] == [(2, "right")]
    assert found[0].t == pytest.approx(0.55)


def test_a_track_that_ends_on_the_line_is_a_half():
    (one,) = crossings(table([[(30.0, 0.0), (30.0, 50.0)]], std=2.0), ACROSS)
    assert one.probability == pytest.approx(0.5)
    (doubtful,) = crossings(table([[(30.0, 0.0), (30.0, 90.0)]], existence=0.7), ACROSS)
    assert doubtful.probability == pytest.approx(0.7)


def test_what_is_not_sure_before_the_line_after_it_and_of_the_track_is_multiplied():
    half_a_sigma = 0.6914624612740131  # of a standard normal below 0.5
    (one,) = crossings(table([[(30.0, 49.0), (30.0, 52.0)]], std=2.0, existence=0.8), ACROSS)
    assert one.probability == pytest.approx(0.8 * half_a_sigma * 0.8413447460685429)


def test_counts_by_interval_and_direction():
    paths = [[(30.0, y) for y in range(0, 101, 20)]] * 3 + [[(60.0, y) for y in range(100, -1, -20)]]
    counts = count(crossings(table(paths), ACROSS), np.array([0.0, 0.2, 1.0]))
    assert [(c.direction, c.t_from, c.count) for c in counts] == [
        ("left", 0.0, 0),
        ("left", 0.2, 1),
        ("right", 0.0, 0),
        ("right", 0.2, 3),
    ]


def test_no_rows_no_crossings():
    assert crossings(Trajectories.empty(), ACROSS) == []


@given(st.lists(st.floats(0.0, 1.0), max_size=7))
def test_the_interval_is_that_of_all_outcomes_counted_one_by_one(probability):
    pmf = np.zeros(len(probability) + 1)
    for outcome in product((0, 1), repeat=len(probability)):
        pmf[sum(outcome)] += np.prod([p if o else 1.0 - p for o, p in zip(outcome, probability, strict=True)])
    low, high = count_interval(probability)
    assert 0 <= low <= high <= len(probability)
    assert pmf[:low].sum() <= 0.025 + 1e-12
    assert pmf[high + 1 :].sum() <= 0.025 + 1e-12
    assert pmf[low : high + 1].sum() >= 0.95 - 1e-12


@pytest.mark.parametrize("ends", [(1.0, 2.0, 1.0, 2.0), (0.0, 0.0, float("nan"), 1.0)])
def test_a_line_needs_two_ends(ends):
    with pytest.raises(DataError, match="gate"):
        Line(*ends, name="gate")


def test_who_goes_round_is_counted_each_time_and_surely():
    """Two rounds about the middle of the picture, over a line from the middle upwards and one downwards."""
    angle = 2.0 * np.pi * np.arange(0.0, 20.0, 0.1) / 8.0 + 0.3
    rounds = table([np.column_stack([400.0 + 200.0 * np.cos(angle), 300.0 + 200.0 * np.sin(angle)])])
    up, down = Line(400.0, 300.0, 400.0, 0.0), Line(400.0, 300.0, 400.0, 600.0)
    for line, first in ((down, 2.0 - 0.3 * 8.0 / (2.0 * np.pi)), (up, 6.0 - 0.3 * 8.0 / (2.0 * np.pi))):
        found = crossings(rounds, line)
        want = np.arange(first, 20.0, 8.0)
        np.testing.assert_allclose([one.t for one in found], want, atol=0.01)
        assert {one.direction for one in found} == {"right"}
        assert all(one.probability > 0.999 for one in found)
