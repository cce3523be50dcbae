"""Vehicles that pass a line while they drive, seen by a camera that is known exactly."""

from __future__ import annotations

import json

import numpy as np
import pytest
from road_scenes import camera as camera_over_road

from jeat_graph.data.embeddings import unpacked_embedding
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.road.crossings import road_line
from jeat_graph.road.lanes import given_lanes
from jeat_graph.road.line_watch import LineWatch, chosen_line

LANES = given_lanes({"slow": (0.0, 4.0), "fast": (4.0, 8.0)})


def table(t, ids, pixels, kinds=None):
    n = len(ids)
    boxes = np.c_[pixels[:, 0] - 20.0, pixels[:, 1] - 30.0, np.full((n, 2), (40.0, 30.0))]
    return Trajectories(
        np.full(n, t),
        np.array(ids, dtype=np.int64),
        boxes,
        np.ones(n),
        np.zeros((n, 6)),
        np.ones((n, 6)),
        np.ones(n, dtype=np.int64),
        ("rgb",),
        classes=None if kinds is None else np.array(kinds),
        class_probability=None if kinds is None else np.ones(n),
    )


def line_at(camera, y):
    pixels = camera.project(np.array([[0.0, y, 0.0], [9.0, y, 0.0]]))[0]
    return road_line(camera, tuple(pixels.ravel()), 0.0)


def drive(watch, camera, speed, x=2.0, start=20.0, hz=10.0, seconds=4.0, noise=0.0, number=1):
    rng = np.random.default_rng(number)
    found = []
    for k in range(int(seconds * hz)):
        place = np.array([[x, start + speed * k / hz, 0.0]])
        pixels = camera.project(place)[0] + noise * rng.normal(size=(1, 2))
        found += watch.take(k / hz, table(k / hz, [number], pixels, ["car"]))
    return found


@pytest.mark.parametrize("speed", [8.0, 20.0, 33.0])
def test_time_speed_and_lane_of_an_even_drive_are_exact(speed):
    camera = camera_over_road()
    watch = LineWatch(camera, line_at(camera, 40.0), "left", LANES)
    (one,) = drive(watch, camera, speed)
    assert one.t == pytest.approx(20.0 / speed, abs=1e-3)
    assert one.speed == pytest.approx(speed, rel=1e-6)
    assert (one.track_id, one.lane, one.kind) == (1, "slow", "car")


def test_the_other_way_and_beside_the_line_count_not():
    camera = camera_over_road()
    assert not drive(LineWatch(camera, line_at(camera, 40.0), "right", LANES), camera, 20.0)
    assert not drive(LineWatch(camera, line_at(camera, 40.0), "left", LANES), camera, 20.0, x=10.0)
    assert drive(LineWatch(camera, line_at(camera, 40.0), "right", LANES), camera, -20.0, start=60.0)


def test_errors_of_boxes_are_within_what_is_said():
    camera = camera_over_road()
    off_t, off_speed = [], []
    for number in range(200):
        watch = LineWatch(camera, line_at(camera, 40.0), "left", LANES)
        (one,) = drive(watch, camera, 20.0, noise=2.0, number=number)
        off_t.append((one.t - 1.0) / one.sigma_t)
        off_speed.append((one.speed / 20.0 - 1.0) / one.sigma_speed)
    # Errors here are independent, and are taken for alike within a quarter of a second: wide intervals.
    assert 0.3 < np.std(off_t) < 1.1
    assert 0.2 < np.std(off_speed) < 1.1


def test_a_state_goes_on_where_it_was():
    camera = camera_over_road()
    found = {}
    for saved_at in (None, 5, 12, 18, 25):
        watch = LineWatch(camera, line_at(camera, 40.0), "left", LANES)
        found[saved_at] = []
        for k in range(40):
            if k == saved_at:
                state = json.loads(json.dumps(watch.state()))
                watch = LineWatch(camera, line_at(camera, 40.0), "left", LANES)
                watch.set_state(state)
            pixels = camera.project(np.array([[2.0, 20.0 + 2.0 * k, 0.0]]))[0]
            found[saved_at] += watch.take(k / 10.0, table(k / 10.0, [3], pixels))
    assert len(found[None]) == 1
    assert all(one == found[None] for one in found.values())


def test_a_track_is_asked_once_for_its_appearance_as_it_passes():
    camera, asked = camera_over_road(), []
    watch = LineWatch(camera, line_at(camera, 40.0), "left", LANES)

    def appearance(identity):
        asked.append((identity, k))
        return np.array([0.5, float(identity)])

    found = []
    for k in range(40):
        pixels = camera.project(np.array([[2.0, 20.0 + 2.0 * k, 0.0], [6.0, 21.0 + 2.0 * k, 0.0]]))[0]
        found += watch.take(k / 10.0, table(k / 10.0, [3, 4], pixels), appearance)
    assert sorted(asked) == [(3, 10), (4, 10)]
    assert [unpacked_embedding(one.appearance).tolist() for one in found] == [[0.5, 3.0], [0.5, 4.0]]


def test_a_track_that_ends_behind_the_line_is_reported_and_forgotten():
    camera = camera_over_road()
    watch = LineWatch(camera, line_at(camera, 40.0), "left", LANES)
    assert not drive(watch, camera, 20.0, seconds=1.6)
    nobody = table(9.0, [], np.zeros((0, 2)))
    assert len(watch.take(9.0, nobody)) == 1
    assert watch.state() == []


def test_which_line_has_to_be_clear():
    assert chosen_line({"a": 1}, None) == "a"
    with pytest.raises(ValueError, match="say which"):
        chosen_line({"a": 1, "b": 2}, None)
    with pytest.raises(ValueError, match="has no line 'c'"):
        chosen_line({"a": 1, "b": 2}, "c")
