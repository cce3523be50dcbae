"""Scans as callers give them: what is none is refused in one line that says what would be."""

from __future__ import annotations

import datetime

import numpy as np
import pytest

from jeat_graph.data.errors import DataError, UnknownSensorError
from jeat_graph.data.scan import Scan, time_of
from jeat_graph.tracking.scans import as_scans, sensor_index

BOXES, SCORES = [[1.0, 2.0, 30.0, 40.0]], [0.9]


@pytest.mark.parametrize(
    "t",
    [
        None,
        datetime.datetime(2024, 5, 1),
        datetime.timedelta(seconds=1),
        np.datetime64("2024-05-01"),
        np.datetime64("2024-05-01", "ns"),
        np.timedelta64(1, "ns"),
        [0.5],
        10**400,
    ],
)
def test_a_time_that_is_no_number_is_said_to_be_none(t):
    with pytest.raises(DataError, match=r"t is a time in seconds \(a number\), got"):
        Scan(t, "rgb", BOXES, SCORES)


@pytest.mark.parametrize("t", [1, np.float32(1), np.int64(1), np.array(1.0)])
def test_numbers_of_all_kinds_are_times(t):
    assert time_of(t) == 1.0


@pytest.mark.parametrize("sensor", [None, 3, ["rgb"]])
def test_a_sensor_without_a_name_is_refused(sensor):
    with pytest.raises(DataError, match="sensor is the name"):
        Scan(0.0, sensor, BOXES, SCORES)


@pytest.mark.parametrize(
    "what",
    [
        (0.0, "rgb", BOXES),
        (0.0, "rgb", BOXES, SCORES, None, None, None),
        (0.0, 3, BOXES, SCORES),
        [(0.0, "rgb", BOXES)],
        {"t": 0.0, "sensor": "rgb", "boxes": BOXES, "scores": SCORES},
        [{"t": 0.0}],
        BOXES,
        np.array(BOXES),
        [],
        "rgb",
        None,
        3,
    ],
)
def test_what_is_no_scan_is_refused_with_what_is(what):
    with pytest.raises(DataError, match=r"step takes a Scan, a tuple \(t, sensor, boxes, scores\)"):
        as_scans(what)


def test_a_scan_may_be_a_list_like_its_tuple():
    (scan,) = as_scans([0.5, "rgb", BOXES, SCORES])
    assert (scan.t, scan.sensor, scan.boxes.tolist()) == (0.5, "rgb", BOXES)


@pytest.mark.parametrize(("name", "hint"), [("rbg", "did you mean 'rgb'?"), ("lidar", "declared: evt, rgb;")])
def test_an_unknown_sensor_is_named_with_the_nearest_one_or_all(name, hint):
    with pytest.raises(UnknownSensorError) as raised:
        sensor_index(name, ["evt", "rgb"])
    assert f"sensor {name!r} is not declared" in str(raised.value)
    assert hint in str(raised.value)
    assert sensor_index("rgb", ["evt", "rgb"]) == 1
