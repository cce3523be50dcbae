"""Vehicles in zones, and their ways between zones and lines."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.errors import DataError
from jeat_graph.eval.counting import Line, count, crossings
from jeat_graph.eval.passing import passages
from jeat_graph.eval.zones import Journey, Zone, journeys, od_table, zone_crossings

from .test_counting import table

SQUARE = Zone("square", ((20.0, 20.0), (60.0, 20.0), (60.0, 60.0), (20.0, 60.0)))


def ways(found):
    return [(c.track_id, c.direction, round(c.t, 6)) for c in found]


def test_a_vehicle_enters_and_leaves_between_its_rows():
    through = [(float(x), 40.0) for x in range(0, 101, 10)]
    assert ways(zone_crossings(table([through]), SQUARE)) == [(1, "in", 0.2), (1, "out", 0.6)]


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


def test_a_zone_thinner_than_a_step_is_entered_and_left_within_it():
    band = Zone("band", ((0.0, 44.0), (100.0, 44.0), (100.0, 54.0), (0.0, 54.0)))
    fast = [(30.0, float(y)) for y in range(0, 101, 20)]  # no row lies within
    found = zone_crossings(table([fast, [(x, y - 3.0) for x, y in fast[::-1]]]), band)
    assert sorted(ways(found)) == [(1, "in", 0.22), (1, "out", 0.27), (2, "in", 0.215), (2, "out", 0.265)]
    assert all(c.probability == 1.0 for c in found)


def test_a_gap_hides_no_zone_and_is_less_sure():
    """A vehicle at 100 px/s that nobody saw between 10 and 90 px; it changes its velocity over the gap."""
    rows = table([[(float(x), 40.0) for x in range(0, 101, 10)]])
    gap = rows.take((rows.mean[:, 0] <= 10.0) | (rows.mean[:, 0] >= 90.0))
    assert ways(zone_crossings(gap, SQUARE)) == [(1, "in", 0.2), (1, "out", 0.6)]
    bends = table([[(float(x), 40.0 + 0.2 * max(0, x - 60)) for x in range(0, 101, 10)]])
    beside = Zone("beside", ((20.0, 42.0), (60.0, 42.0), (60.0, 60.0), (20.0, 60.0)))
    bent = bends.take((bends.mean[:, 0] <= 10.0) | (bends.mean[:, 0] >= 90.0))
    (into, _) = passages(bent, beside)
    assert 0.5 < into.probability < 1.0


@pytest.mark.parametrize("known", [True, False])
def test_who_stands_at_the_edge_and_jitters_neither_comes_nor_goes(known):
    """1,500 rows, 3 px beside the edge and on it, white jitter of 1.5 px."""
    rng = np.random.default_rng(3)
    for beside in (-3.0, 0.0, 3.0):
        rows = table([np.array([60.0 + beside, 40.0]) + 1.5 * rng.standard_normal((1500, 2))], std=1.5)
        if not known:
            rows = replace(rows, var=np.full_like(rows.var, np.nan))
        assert zone_crossings(rows, SQUARE) == []


@given(st.integers(0, 10**6))
def test_a_way_enters_and_leaves_as_its_points_close_by_say(seed):
    """Brute force: the same way with 2,000 points a step, each within the zone or not."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(0, 100, (int(rng.integers(3, 7)), 2))
    zone = Zone("zone", tuple(map(tuple, corners.tolist())))
    way = rng.uniform(-20, 120, (4, 2))
    found = zone.meetings(way[None])
    at = np.linspace(0.0, 3.0, 6001)
    fine = np.column_stack([np.interp(at, np.arange(4), column) for column in way.T])
    within = zone.holds(fine)
    change = np.flatnonzero(within[1:] != within[:-1])
    # Two crossings closer together than the fine points are not seen by brute force.
    if len(found.at) and np.diff(found.at, prepend=-1.0, append=9.0).min() > 2e-3:
        np.testing.assert_allclose(found.at, at[change], atol=1e-3)
        np.testing.assert_array_equal(found.second == 1, within[change])


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


def test_who_turns_goes_from_the_origin_to_the_origin():
    turns = [(40.0, float(y)) for y in (0, 20, 40, 40, 20, 0)]
    through = [(40.0, float(y)) for y in range(0, 101, 10)]
    tracks = table([turns, through])
    found = [c for line in (NORTH, SOUTH) for c in crossings(tracks, line)]
    assert [(j.origin, j.destination) for j in journeys(found)] == [("north", "north"), ("north", "south")]
    into_and_out = zone_crossings(table([[(x, 40.0) for x in range(0, 101, 10)]]), SQUARE)
    assert [(j.origin, j.destination) for j in journeys(into_and_out)] == [("square", "")]


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
