"""Traffic at a line: counts, speeds and headways of vehicles whose motion is known, and the page of it."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from road_scenes import camera

from jeat_graph.road.boxes_road import SizedVehicle
from jeat_graph.road.inputs import RoadMarks
from jeat_graph.road.lanes import LaneConfig, no_lanes
from jeat_graph.road.motion_fit import MotionFit
from jeat_graph.road.points_road import summarise
from jeat_graph.road.results import (
    LeftOut,
    RoadResult,
    Size,
    left_out_columns,
    speed_columns,
    with_own_classes,
)
from jeat_graph.road.road_page import render_road_page
from jeat_graph.road.speeds import UNKNOWN_SPEED, ContactConfig, Speed, Vehicle, interval
from jeat_graph.road.traffic import SummaryConfig, count_columns, headway_columns, speed_summary

LENGTH = 4.0


def _vehicle(number: int, x: float, t_at_50: float, speed: float, var: float = 0.0) -> SizedVehicle:
    """One that drives away from the camera at constant speed and passes y = 50 m at a known time."""
    t = np.linspace(t_at_50 - 2.0, t_at_50 + 2.0, 41)
    coefficients = np.array([[x, 0.0, 0.0], [50.0, speed, 0.0]])
    covariance = np.diag([var, 0.0, 0.0, var, 0.0, 0.0])
    fit = MotionFit(
        t_at_50, np.zeros(0), coefficients, covariance, np.zeros((6, 0, 2)), t, np.zeros((41, 2)), np.ones(41)
    )
    vehicle = Vehicle(number, t, fit, np.zeros((6, 6)), 0.0, 0.0)
    return SizedVehicle(vehicle, Size((LENGTH, 1.8, 1.5), (0.01, 0.01, 0.01)), "car", 1.0)


def _result() -> RoadResult:
    sized = [_vehicle(k, 0.0, 10.0 + 3.0 * k, 20.0 + k, 0.04) for k in range(4)]
    sized += [_vehicle(4 + k, 3.6, 40.0 + 2.0 * k, 30.0) for k in range(2)]
    return summarise(
        [one.vehicle for one in sized],
        camera(),
        RoadMarks({}, {"slow": (-1.8, 1.8), "fast": (1.8, 5.4)}),
        ContactConfig(0.0, 0.0, 0.0),
        LaneConfig(),
        sized,
    )


def _rows_of(columns, direction="all", lane="all", kind="all"):
    return (columns["direction"] == direction) & (columns["lane"] == lane) & (columns["class"] == kind)


def test_without_lines_all_are_counted_where_most_come_by() -> None:
    result = _result()
    assert {line for line, _, _ in result.crossings} == {"middle"}
    assert len(result.crossings) == 6


def test_counts_by_lane_class_and_interval() -> None:
    columns = count_columns(_result(), SummaryConfig(interval_s=30.0))
    rows = [
        (lane, kind, start, count)
        for lane, kind, start, count in zip(
            *(columns[k].tolist() for k in ("lane", "class", "t_start", "count")), strict=True
        )
    ]
    assert ("slow", "car", 0.0, 4) in rows
    assert ("all", "all", 30.0, 2) in rows
    assert ("slow", "all", 30.0, 0) in rows
    slow = _rows_of(columns, lane="slow")
    assert columns["mean_kmh"][slow][0] == pytest.approx(3.6 * 21.5, abs=0.01)
    assert columns["per_hour"][slow][0] == pytest.approx(480.0)


def test_intervals_in_which_nobody_came_by_have_rows_without_speeds() -> None:
    columns = count_columns(replace(_result(), span_s=(-5.0, 125.0)), SummaryConfig(interval_s=30.0))
    whole = _rows_of(columns)
    assert columns["t_start"][whole].tolist() == [-30.0, 0.0, 30.0, 60.0, 90.0, 120.0]
    assert columns["count"][whole].tolist() == [0, 4, 2, 0, 0, 0]
    assert np.isnan(columns["per_hour"][whole][[0, -1]]).all()  # 5 s of each were recorded
    assert columns["per_hour"][whole].tolist()[1:-1] == [480.0, 240.0, 0.0, 0.0]
    assert np.isnan(columns["mean_kmh"][whole]).tolist() == [True, False, False, True, True, True]
    names = ("direction", "lane", "class", "t_start")
    keys = list(zip(*(columns[name].tolist() for name in names), strict=True))
    # All and one direction, all, slow and fast lanes, cars and all classes, by interval.
    assert len(keys) == len(set(keys)) == 2 * 6 * 6


def test_vehicles_an_hour_are_of_the_time_that_was_observed() -> None:
    """Four vehicles in the ten seconds of the first half minute that were recorded: 1440 an hour."""
    columns = count_columns(replace(_result(), span_s=(20.0 - 10.0, 20.0)), SummaryConfig(interval_s=30.0))
    whole = _rows_of(columns)
    assert columns["count"][whole].tolist() == [4, 2]
    assert columns["observed"][whole].tolist() == [pytest.approx(100.0 / 3.0, abs=1e-3), 0.0]
    assert columns["per_hour"][whole][0] == 1440.0
    assert np.isnan(columns["per_hour"][whole][1])


def test_rows_add_up_although_some_are_in_no_lane_and_of_no_class() -> None:
    sized = [_vehicle(k, x, 10.0 + 3.0 * k, 20.0) for k, x in enumerate((0.0, 0.0, 3.6, 9.0))]
    away = _vehicle(4, 0.0, 25.0, 20.0)
    back = away._replace(
        vehicle=replace(
            away.vehicle, fit=away.vehicle.fit._replace(coefficients=np.array([[0, 0, 0], [50, -20, 0]]))
        )
    )
    sized.append(back)
    marks = RoadMarks({}, {"slow": (-1.8, 1.8), "fast": (1.8, 5.4)})
    vehicles = [one.vehicle for one in sized]
    result = summarise(vehicles, camera(), marks, ContactConfig(0.0, 0.0, 0.0), LaneConfig(), sized)
    result = with_own_classes(result, {0: "bus", 1: "taxi", 2: "", 3: "taxi"})
    columns = count_columns(result, SummaryConfig())
    assert columns["count"][_rows_of(columns)].tolist() == [5]
    names = {"direction": ["left", "right"], "lane": ["slow", "fast", ""], "class": ["bus", "taxi", ""]}
    key = {"direction": "direction", "lane": "lane", "class": "kind"}
    for column, values in names.items():
        assert set(columns[column].tolist()) == {"all", *values}
        parts = [columns["count"][_rows_of(columns, **{key[column]: one})].sum() for one in values]
        assert sum(parts) == 5
    assert columns["count"][_rows_of(columns, lane="")].tolist() == [1]
    assert columns["count"][_rows_of(columns, kind="")].tolist() == [2]
    assert columns["count"][_rows_of(columns, direction="right")].tolist() == [1]


def test_without_lanes_and_classes_only_directions_divide() -> None:
    bare = replace(_result(), lanes=no_lanes(), classes=[""] * 6)
    columns = count_columns(bare, SummaryConfig())
    assert columns["direction"].tolist() == ["all", "left"]
    assert columns["lane"].tolist() == columns["class"].tolist() == ["all", "all"]


def test_tracks_without_classes_keep_those_by_length() -> None:
    result = _result()
    assert with_own_classes(result, dict.fromkeys(range(6), "")).classes == result.classes


def test_intervals_are_of_the_clock_that_is_given() -> None:
    clock = SummaryConfig(interval_s=30.0, begin_s=1000.0)  # 10 s after a multiple of 30 s
    columns = count_columns(replace(_result(), span_s=(0.0, 45.0)), clock)
    whole = _rows_of(columns)
    early = sum(one.t < 20.0 for _, _, one in _result().crossings)
    assert columns["t_start"][whole].tolist() == [990.0, 1020.0]
    assert columns["count"][whole].tolist() == [early, 6 - early]
    assert 0 < early < 6
    times = headway_columns(_result(), clock)["t"] - headway_columns(_result(), SummaryConfig())["t"]
    np.testing.assert_allclose(times, 1000.0)


def test_a_line_that_nobody_crosses_is_counted_too() -> None:
    result = replace(_result(), lines=("aside", "middle"), span_s=(0.0, 60.0))
    columns = count_columns(result, SummaryConfig(interval_s=30.0))
    aside = columns["line"] == "aside"
    assert columns["count"][aside].tolist() == [0, 0]
    assert columns["lane"][aside].tolist() == ["all", "all"]


def test_headways_are_from_front_to_front_and_gaps_from_rear_to_front() -> None:
    columns = headway_columns(_result(), SummaryConfig())
    first = (columns["track_id"] == 1) & (columns["ahead_id"] == 0)
    at = float(columns["t"][first][0])  # of the line, which need not be at 50 m
    y = 50.0 + 21.0 * (at - 13.0)
    ahead, behind = 10.0 + (y - LENGTH / 2 - 50.0) / 20.0, 13.0 + (y - LENGTH / 2 - 50.0) / 21.0
    assert columns["headway_s"][first][0] == pytest.approx(behind - ahead, abs=2e-3)
    assert columns["gap_s"][first][0] == pytest.approx(behind - ahead - LENGTH / 20.0, abs=2e-3)
    assert columns["gap_m"][first][0] == pytest.approx(21.0 * (behind - ahead - LENGTH / 20.0), abs=0.05)
    sigma = np.sqrt(0.04 / 20.0**2 + 0.04 / 21.0**2 + (0.1 / 2 / 20.0) ** 2 + (0.1 / 2 / 21.0) ** 2)
    half = columns["headway_s_high"][first][0] - columns["headway_s"][first][0]
    assert half == pytest.approx(1.96 * sigma, abs=2e-3)


def test_intervals_of_the_mean_add_noise_and_keep_calibration() -> None:
    speeds = [interval(v, 1.0, 0.5) for v in np.linspace(80.0, 120.0, 100)]
    mean, low, high, p85, p85_low, p85_high = speed_summary(speeds, SummaryConfig())
    assert mean == pytest.approx(100.0)
    assert high - mean == pytest.approx(1.96 * np.hypot(0.1, 0.5), rel=1e-3)
    assert mean - low == pytest.approx(high - mean)
    assert p85 == pytest.approx(np.percentile([s.kmh for s in speeds], 85))
    assert p85_low < p85 < p85_high


def test_the_calibrations_share_does_not_average_away() -> None:
    few, many = ([Speed(90.0, 2.0, 0.7, 0.0, 0.0)] * n for n in (1, 400))
    widths = [np.subtract(*speed_summary(s, SummaryConfig())[2:0:-1]) for s in (few, many)]
    assert widths[1] == pytest.approx(2 * 1.96 * 0.7, rel=0.02)
    assert widths[0] > 2.5 * widths[1]


class _Ids(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.bad: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "rect", "line", "path", "img", "br"):
            self.open.append(tag)
        self.bad += [f"{k}={v}" for k, v in attrs if k in ("src", "href") and v and "data:" not in v]

    def handle_endtag(self, tag: str) -> None:
        if tag in ("rect", "line", "path"):
            return
        assert self.open.pop() == tag


def test_the_page_holds_everything_and_asks_for_nothing() -> None:
    page = render_road_page(_result(), camera(), SummaryConfig(), "<road> & co")
    parser = _Ids()
    parser.feed(page)
    assert parser.open == []
    assert parser.bad == []
    assert "&lt;road&gt; &amp; co" in page
    assert len(re.findall(r'class="bars"', page)) == 2
    assert len(re.findall(r'class="way"', page)) == 12
    for lane in ("slow", "fast"):
        assert f"Lane {lane}" in page
    assert page == render_road_page(_result(), camera(), SummaryConfig(), "<road> & co")


def test_who_stands_all_the_time_is_parked_and_shows_no_lane() -> None:
    standing = [_vehicle(10 + k, 9.0, 10.0 + 5.0 * k, 0.0) for k in range(3)]
    longer = [
        one._replace(vehicle=replace(one.vehicle, fit=one.vehicle.fit._replace(t=3.0 * one.vehicle.fit.t)))
        for one in standing
    ]
    sized = [_vehicle(k, 0.0, 10.0 + 3.0 * k, 20.0) for k in range(4)] + longer
    vehicles = [one.vehicle for one in sized]
    out = LeftOut(99, 1.0, 2.0, "too little of it is on the road")
    none = RoadMarks({}, {})
    contact = ContactConfig(0.0, 0.0, 0.0)
    result = summarise(vehicles, camera(), none, contact, LaneConfig(), sized, None, [out])
    assert list(result.parked) == [False] * 4 + [True] * 3
    assert result.lanes.names == ("1",)
    assert list(result.lane_names) == ["1"] * 4 + [""] * 3
    assert speed_columns(result)["parked"].tolist() == [0] * 4 + [1] * 3
    columns = left_out_columns(result)
    assert columns["track_id"].tolist() == [99]
    assert columns["reason"].tolist() == ["too little of it is on the road"]


def test_speeds_that_are_not_known_are_left_out_of_the_page_and_the_means() -> None:
    known = _result()
    speeds = [*known.speeds[:-1], UNKNOWN_SPEED]
    crossings = [
        (line, k, one._replace(speed=UNKNOWN_SPEED) if k == 5 else one) for line, k, one in known.crossings
    ]
    result = replace(known, speeds=speeds, crossings=crossings)
    page = render_road_page(result, camera(), SummaryConfig(), "one unknown")
    assert "nan" not in re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL).lower().split()
    columns = count_columns(result, SummaryConfig(interval_s=300.0))
    whole = _rows_of(columns)
    assert columns["count"][whole].tolist() == [6]
    assert np.isfinite(columns["mean_kmh"][whole]).all()
    none = replace(result, speeds=[UNKNOWN_SPEED] * 6)
    assert "Speeds by lane" in render_road_page(none, camera(), SummaryConfig(), "none known")
    assert np.isfinite(headway_columns(result, SummaryConfig())["headway_s"]).all()


def test_a_road_without_vehicles_has_a_page_too() -> None:
    none = summarise([], camera(), RoadMarks({}, {}), ContactConfig(), LaneConfig())
    assert "No vehicle" in render_road_page(none, camera(), SummaryConfig(), "empty")
    assert len(count_columns(none, SummaryConfig())["line"]) == 0
    assert len(headway_columns(none, SummaryConfig())["line"]) == 0
