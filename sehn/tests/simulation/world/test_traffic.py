"""Traffic: smooth, free of collisions, as dense as configured."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from jeat_graph.data.errors import ConfigError
from jeat_graph_sehn.simulation.scenario import load_scenario
from jeat_graph_sehn.simulation.world.road import Road, RoadConfig
from jeat_graph_sehn.simulation.world.scene import Scene
from jeat_graph_sehn.simulation.world.traffic import TrafficConfig
from jeat_graph_sehn.simulation.world.vehicles import KIND_NAMES


@cache
def build(density: str, seed: int, duration_s: float = 20.0) -> Scene:
    s = load_scenario("day", density)
    return Scene.build(seed, duration_s, s.road, s.fleet, s.traffic, s.light, s.camera)


# In the dense seeds, a driver who changes lanes must mind a slow leader that is not the nearest vehicle.
@pytest.mark.parametrize(
    ("density", "seed"), [("sparse", 1), ("normal", 2), ("dense", 3), ("dense", 101), ("dense", 108)]
)
def test_no_two_vehicles_overlap(density: str, seed: int) -> None:
    scene = build(density, seed)
    states = scene.states_at(np.arange(0.0, 20.0, 0.1), far_m=280.0, near_m=-120.0)
    half = states.size[:, :2] / 2.0
    for frame in range(200):
        rows = np.flatnonzero(states.frame == frame)
        # Headings are a few degrees at most; the boxes along the axes are grown by what these could add.
        grow_x = half[rows, 0] * np.abs(np.sin(states.pose[rows, 2]))
        dx = np.abs(np.subtract.outer(states.pose[rows, 0], states.pose[rows, 0]))
        dy = np.abs(np.subtract.outer(states.pose[rows, 1], states.pose[rows, 1]))
        clear_x = dx > np.add.outer(half[rows, 1] + grow_x, half[rows, 1] + grow_x)
        clear_y = dy > np.add.outer(half[rows, 0], half[rows, 0]) + 0.2
        assert (clear_x | clear_y | np.eye(len(rows), dtype=bool)).all(), f"collision at {frame / 10} s"


@pytest.mark.parametrize("density", ["normal", "dense"])
def test_velocity_and_acceleration_are_derivatives_of_the_path(density: str) -> None:
    paths, h = build(density, {"normal": 2, "dense": 3}[density]).traffic.paths, 1e-4
    t = np.linspace(0.0131, 19.9, 301)
    for motion in (paths.along_at, paths.across_at):
        before, now, after = motion(t - h), motion(t), motion(t + h)
        # Jerk along the road jumps between steps, which such a difference sees as at most jump * h.
        assert now[1] == pytest.approx((after[0] - before[0]) / (2 * h), abs=1e-5)
        assert now[2] == pytest.approx((after[1] - before[1]) / (2 * h), abs=3e-3)


def test_position_speed_and_acceleration_do_not_jump() -> None:
    paths = build("dense", 3).traffic.paths
    knots = paths.start_s + paths.step_s * np.arange(20, 400)
    for motion in (paths.along_at, paths.across_at):
        before, after = motion(knots - 1e-9), motion(knots + 1e-9)
        assert before[:3] == pytest.approx(after[:3], abs=1e-5)


@pytest.mark.parametrize("density", ["sparse", "normal", "dense"])
def test_the_mean_number_of_vehicles_in_view_is_as_configured(density: str) -> None:
    config = load_scenario("day", density).traffic
    counts = []
    for seed in range(3):
        scene = build(density, seed)
        states = scene.states_at(np.arange(0.0, 20.0, 0.5), far_m=config.view_m, near_m=0.0)
        counts.append((~states.parked).sum() / 40.0)
        assert states.parked.sum() == 40 * config.parked
    assert np.mean(counts) == pytest.approx(config.vehicles_in_view, rel=0.15)


def test_vehicles_drive_in_both_directions_change_lanes_and_differ_in_speed() -> None:
    traffic = build("normal", 7, 30.0).traffic
    assert set(traffic.direction) == {-1, 1}
    assert len(traffic.paths.change_start) >= 5
    speed = traffic.paths.along[..., 1]
    assert speed.min() >= 0.0
    assert np.percentile(speed, 95) - np.percentile(speed, 5) > 5.0
    assert np.percentile(speed, 95) > 28.0


def test_trucks_keep_out_of_the_lane_beside_the_median() -> None:
    scene = build("dense", 8, 30.0)
    truck = KIND_NAMES[scene.fleet.kind] == "truck"
    x = scene.traffic.paths.across_at(np.arange(0.0, 30.0, 0.5))[0][:, truck]
    assert truck.any()
    assert np.abs(x).min() > scene.road.config.median_m / 2 + scene.road.config.lane_width_m


def test_a_vehicle_that_comes_round_again_is_a_new_object() -> None:
    scene = build("sparse", 9, 20.0)
    times = np.arange(0.0, 20.0, 0.05)
    states = scene.states_at(times, far_m=280.0, near_m=-120.0)
    for identity in np.unique(states.object_id[~states.parked]):
        y = states.pose[states.object_id == identity, 1]
        assert np.abs(np.diff(y)).max(initial=0.0) < 45.0 * 0.05


def test_object_ids_do_not_depend_on_the_times_asked_for() -> None:
    scene = build("normal", 10)
    whole = scene.states_at(np.array([3.0, 17.0]), far_m=150.0)
    late = scene.states_at(np.array([17.0]), far_m=150.0)
    assert np.array_equal(whole.object_id[whole.frame == 1], late.object_id)
    assert np.array_equal(whole.pose[whole.frame == 1], late.pose)


def test_the_road_keeps_to_the_right() -> None:
    road = Road.build(RoadConfig())
    assert road.lane_x == pytest.approx([-11.375, -7.625, -3.875, 3.875, 7.625, 11.375])
    assert list(road.direction) == [-1, -1, -1, 1, 1, 1]


def test_too_much_traffic_is_refused() -> None:
    s = load_scenario("day")
    jam = TrafficConfig(vehicles_normal=400.0)
    with pytest.raises(ConfigError, match="no room"):
        Scene.build(0, 5.0, s.road, s.fleet, jam, s.light, s.camera)


def test_a_vehicle_stops_when_the_scenario_says_and_the_next_one_waits_behind_it() -> None:
    s = load_scenario("night-nolight-stop")
    scene = Scene.build(0, 21.1, s.road, s.fleet, replace(s.traffic, stopped=3), s.light, s.camera)
    begin, end = scene.traffic.paths.along_at(np.array([s.traffic.stop_at_s, 20.5]))[1]
    stood = (begin > 5.0) & (end < 0.1)
    assert stood.sum() >= 3
    still = scene.traffic.paths.along_at(np.array([s.traffic.stop_at_s - 0.1]))[1][0, stood]
    assert (still > 5.0).all()


def test_who_stops_begins_to_brake_before_the_recording_unless_told_otherwise() -> None:
    assert TrafficConfig().stop_at_s == -8.0
    with pytest.raises(ConfigError, match="stop_at_s"):
        TrafficConfig(stop_at_s=-20.0)
