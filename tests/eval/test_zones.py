"""Vehicles in zones, and their ways between zones and lines."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.errors import DataError
from jeat_graph.eval.counting import Line, count, crossings
from jeat_graph.eval.zones import Journey, Zone, journeys, od_table, zone_crossings

from .test_counting import table

SQUARE = Zone("square", ((20.0, 20.0), (60.0, 20.0), (60.0, 60.0), (20.0, 60.0)))


def ways(found):
    return [(c.track_id, c.direction, round(c.t, 6)) for c in found]


def test_a_vehicle_enters_and_leaves_between_its_rows():
    through = [(float(x), 40.0) for x in range(0, 101, 10)]
    assert ways(zone_crossings(table([through]), SQUARE)) == [(1, "in", 0.15), (1, "out", 0.55)]


def test_one_that_begins_or_ends_within_has_not_come_or_gone():
    begins = [(40.0, 40.0), (80.0, 40.0)]
    ends = [(0.0, 40.0), (40.0, 40.0)]
    assert ways(zone_crossings(table([begins, ends]), SQUARE)) == [(1, "out", 0.05), (2, "in", 0.05)]


def test_one_that_is_away_for_a_moment_has_not_left():
    wavering = [(x, 40.0) for x in (0, 30, 61, 59, 61, 59, 80)]
    assert [way for _, way, _ in ways(zone_crossings(table([wavering]), SQUARE))] == ["in", "out"]
    comes_again = [(0, 40.0), (30, 40.0), *[(80, 40.0)] * 11, (30, 40.0), (80, 40.0)]
    assert [way for _, way, _ in ways(zone_crossings(table([comes_again]), SQUARE))] == ["in", "out"] * 2


@given(st.integers(0, 10**6))
def test_within_is_what_opencv_says(seed):
    rng = np.random.default_rng(seed)
    corners = rng.integers(0, 100, (int(rng.integers(3, 8)), 2)).astype(np.float32)
    places = rng.uniform(0, 100, (50, 2)).astype(np.float32)
    inside = Zone("zone", tuple(map(tuple, corners.tolist()))).holds(places.astype(float))
    for place, found in zip(places.tolist(), inside.tolist(), strict=True):
        distance = cv2.pointPolygonTest(corners, place, True)
        assert abs(distance) < 1e-3 or found == (distance > 0)


def test_a_zone_needs_three_corners():
    with pytest.raises(DataError, match="zone north: needs three corners or more"):
        Zone("north", ((0.0, 0.0), (1.0, 1.0)))


NORTH = Line(0.0, 10.0, 100.0, 10.0, "north")
SOUTH = Line(0.0, 90.0, 100.0, 90.0, "south")


def test_the_way_of_a_vehicle_leads_from_the_first_place_to_the_last():
    down = [(40.0, float(y)) for y in range(0, 101, 10)]
    past = [(90.0, float(y)) for y in range(0, 101, 10)]
    stays = [(40.0, 0.0), (40.0, 15.0), (40.0, 15.0)]
    tracks = table([down, past[::-1], stays])
    found = [c for line in (NORTH, SOUTH) for c in crossings(tracks, line)]
    found += zone_crossings(tracks, SQUARE)
    assert {(j.track_id, j.origin, j.destination) for j in journeys(found)} == {
        (1, "north", "south"),
        (2, "south", "north"),
        (3, "north", ""),
    }


def test_the_table_has_every_way_every_class_and_every_interval():
    found = [
        Journey(1, "a", "b", 1.0, 4.0, "car"),
        Journey(2, "a", "b", 2.0, 12.0, "car"),
        Journey(3, "b", "", 13.0, 13.0, "truck"),
    ]
    rows = od_table(found, np.array([0.0, 10.0, 20.0]), ["a", "b"])
    assert len(rows) == 2 * 3 * 2 * 2
    known = {(r.origin, r.destination, r.vehicle_class, r.t_from): r.count for r in rows if r.count}
    assert known == {
        ("a", "b", "car", 0.0): 1,
        ("a", "b", "car", 10.0): 1,
        ("b", "", "truck", 10.0): 1,
    }


def test_zones_that_nobody_enters_count_none_in_both_directions():
    rows = count([], np.array([0.0, 10.0]), zones=["square"])
    assert [(r.line, r.direction, r.count) for r in rows] == [("square", "in", 0), ("square", "out", 0)]
