"""Flow, occupancy and headway over a line, against what follows from the vehicles' sizes and speeds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from jeat_graph.eval.counting import Line, crossings
from jeat_graph.eval.passing import LineCrossing
from jeat_graph.eval.stations import covered_s, stations

from .test_counting import table

GATE = Line(0.0, 50.0, 100.0, 50.0, "gate")


def test_a_box_of_ten_px_at_fifty_px_a_second_covers_the_line_for_a_fifth_of_a_second():
    tracks = table([[(30.0, 5.0 * k) for k in range(21)]])
    (one,) = crossings(tracks, GATE)
    assert covered_s(tracks, GATE, one) == pytest.approx(0.2)


def test_a_vehicle_that_drives_aslant_is_as_long_as_its_box_is_across_the_line():
    """Across a line at 45 degrees a box of 10 x 10 px extends by 10 √2 px; it moves at 50 √2 px/s."""
    tracks = table([[(5.0 * k, 5.0 * k) for k in range(21)]])
    line = Line(0.0, 100.0, 100.0, 0.0)
    (one,) = crossings(tracks, line)
    assert covered_s(tracks, line, one) == pytest.approx(0.2)


def passing(t, track, kind="car", way="right"):
    return LineCrossing("gate", track, t, way, 1.0, kind)


def test_records_have_flow_occupancy_headway_and_classes():
    found = [passing(2.0, 1), passing(6.0, 2, "truck"), passing(12.0, 3)]
    rows = stations(found, [0.5, 1.5, 0.5], ["gate"], np.array([0.0, 10.0, 20.0]), (0.0, 15.0))
    right = [row for row in rows if row.direction == "right"]
    assert [row.flow for row in right] == [2, 1]
    assert [row.observed for row in right] == [100.0, 50.0]
    assert right[0].flow_per_hour == 720.0
    assert math.isnan(right[1].flow_per_hour)  # of 5 s nothing an hour is told
    longer = stations(found, [0.5] * 3, ["gate"], np.array([0.0, 10.0, 30.0]), (0.0, 20.0))
    assert [row.flow_per_hour for row in longer if row.direction == "right"] == [720.0, 360.0]  # 1 in 10 s
    assert [row.occupancy for row in right] == pytest.approx([20.0, 10.0])
    assert [row.headway_s for row in right] == [4.0, 6.0]
    assert [row.by_class for row in right] == [{"car": 1, "truck": 1}, {"car": 1, "truck": 0}]
    left = [row for row in rows if row.direction == "left"]
    assert [row.flow for row in left] == [0, 0]
    assert all(row.occupancy == 0.0 and math.isnan(row.headway_s) for row in left)


def test_two_side_by_side_occupy_a_line_once():
    found = [passing(5.0, 1), passing(5.5, 2)]
    rows = stations(found, [1.0, 1.0], ["gate"], np.array([0.0, 10.0]), (0.0, 10.0))
    assert max(row.occupancy for row in rows) == pytest.approx(15.0)


def test_an_interval_that_nobody_watched_has_no_flow_an_hour():
    rows = stations([], [], ["gate"], np.array([0.0, 10.0, 20.0]), (0.0, 10.0))
    unseen = [row for row in rows if row.t_from == 10.0]
    assert all(row.observed == 0.0 and math.isnan(row.flow_per_hour) for row in unseen)


def test_lanes_and_speeds_of_a_road_make_records_of_their_own():
    found = [passing(2.0, 1), passing(3.0, 2), passing(6.0, 3)]
    rows = stations(
        found,
        [0.1] * 3,
        ["gate"],
        np.array([0.0, 10.0]),
        (0.0, 10.0),
        ["lane-1", "lane-2", "lane-1"],
        [50.0, math.nan, 60.0],
    )
    known = {row.lane: (row.flow, row.headway_s, row.speed_kmh) for row in rows if row.direction == "right"}
    assert known["lane-1"] == (2, 4.0, 55.0)
    assert known["lane-2"][0] == 1
    assert math.isnan(known["lane-2"][2])
