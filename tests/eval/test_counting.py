"""Vehicles that cross a line."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.eval.counting import Line, count, count_interval, crossings
from jeat_graph.eval.passing import passages


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


def test_who_turns_back_crosses_both_ways_and_who_jitters_on_the_line_once():
    """The string is four standard deviations long: what goes to and fro by less than eight stays."""
    there_and_back = [(30.0, y) for y in (0, 40, 60, 40, 0)]
    wavering = [(30.0, y) for y in (0, 47, 53, 47, 53, 47, 53, 100)]
    stops_short = [(30.0, y) for y in (0, 40, 48, 51, 48, 49, 50, 48, 20, 0)]
    found = crossings(table([there_and_back, wavering, stops_short]), ACROSS)
    assert [(c.track_id, c.direction) for c in found] == [(1, "right"), (1, "left"), (2, "right")]
    assert [c.t for c in found] == pytest.approx([0.15, 0.25, 0.55])


def test_a_track_that_ends_on_the_line_is_a_half():
    (one,) = crossings(table([[(30.0, 0.0), (30.0, 50.0)]], std=2.0), ACROSS)
    assert one.probability == pytest.approx(0.5, abs=1.0 / 65)
    (doubtful,) = crossings(table([[(30.0, 0.0), (30.0, 90.0)]], existence=0.7), ACROSS)
    assert doubtful.probability == pytest.approx(0.7)


def test_what_is_not_sure_of_the_begin_and_of_the_track_is_multiplied():
    half_a_sigma = 0.6914624612740131  # of a standard normal below 0.5
    (one,) = crossings(table([[(30.0, 49.0), (30.0, 70.0), (30.0, 90.0)]], std=2.0, existence=0.8), ACROSS)
    assert one.probability == pytest.approx(0.8 * half_a_sigma, abs=1.5 / 65)
    beyond = passages(table([[(30.0, 51.0), (30.0, 70.0), (30.0, 90.0)]], std=2.0), ACROSS)
    assert [c.counted for c in beyond] == [False]
    assert beyond[0].probability == pytest.approx(1.0 - half_a_sigma, abs=1.5 / 65)


def test_the_interval_holds_what_is_counted_and_what_is_possible():
    surely = [[(30.0, y) for y in range(0, 101, 20)]] * 3
    short = [[(30.0, 0.0), (30.0, 25.0), (30.0, 48.5)]] * 8  # each of them crosses with 23 %
    (right,) = count(passages(table([*surely, *short], std=2.0), ACROSS), np.array([0.0, 1.0]), ["gate"])
    assert (right.count, right.low) == (3, 3)
    assert right.high == 3 + 4  # of eight with 23 % each: four or fewer with 97.5 %
    assert right.expected == pytest.approx(3 + 8 * 0.2266, abs=8 / 65)
    doubtful = count(passages(table(surely, existence=0.6), ACROSS), np.array([0.0, 1.0]), ["gate"])[-1]
    assert (doubtful.low, doubtful.count, doubtful.high) == (0, 3, 3)


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


def test_intervals_hold_the_truth_of_simulated_counts():
    """60 recordings of 25 vehicles, half of which are lost near the line, seen with an error of 6 px.

    Some tracks are of nothing, as often as their existence says. The 95 % intervals hold the true number in
    95 % or more (an interval of whole numbers holds more), and they always hold what was counted.
    """
    rng = np.random.default_rng(11)
    held = 0
    for _ in range(60):
        paths, ends, exists = [], [], rng.uniform(0.7, 1.0, 25)
        for k in range(25):
            last = 50.0 + 8.0 * rng.standard_normal() if k % 2 else 100.0
            y = np.arange(0.0, last, 12.0)
            paths.append(
                np.column_stack([np.full(len(y) + 1, 30.0), [*y, last]]) + 6.0 * rng.standard_normal(2)
            )
            ends.append(last)
        rows = table(paths, std=6.0)
        rows = replace(rows, existence=exists[rows.track_id - 1])
        true = int(((np.array(ends) > 50.0) & (rng.random(25) < exists)).sum())
        (right,) = (c for c in count(passages(rows, ACROSS), np.array([0.0, 9.0])) if c.direction == "right")
        assert right.low <= right.count <= right.high
        held += right.low <= true <= right.high
    assert held >= 0.93 * 60
