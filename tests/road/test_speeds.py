"""Speeds of vehicles: unbiased, with intervals that hold what they promise, bad ends of tracks included."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from road_scenes import camera, drives, see

from jeat_graph.data.trajectories import Trajectories
from jeat_graph.eval.counting import Line, crossings
from jeat_graph.road.crossings import crossing, road_line
from jeat_graph.road.lanes import LaneConfig, find_lanes
from jeat_graph.road.motion_fit import MotionFitConfig, error_covariance, fit_motion, thinned
from jeat_graph.road.speeds import ContactConfig, Vehicle, fit_vehicle, interval, reported_speed
from jeat_graph.road.stuck import vehicles_part

MOTION = MotionFitConfig()
ON_ROAD = ContactConfig(height_m=0.0, height_sd_m=0.0, spread_m=0.0)


def _one(t: np.ndarray, pixels: np.ndarray, cam=None, contact: ContactConfig = ON_ROAD) -> Vehicle:
    vehicle = fit_vehicle(1, t, pixels, camera() if cam is None else cam, MOTION, contact)
    assert vehicle is not None
    return vehicle


def test_exact_points_give_the_exact_speed() -> None:
    t = np.arange(0.0, 1.0, 0.02)
    y = 42.0 - 20.0 * t
    vehicle = _one(t, see(camera(), np.c_[np.full(50, 4.0), y]))
    assert vehicle.mean_speed(*vehicle.fit.window()).kmh == pytest.approx(
        72.0, abs=0.03
    )  # means of neighbours: the picture bends


def test_fit_is_the_dense_bayesian_solution() -> None:
    """The coefficients' covariance is that of the joint Gaussian of prior and errors, worked out by Schur."""
    rng = np.random.default_rng(1)
    t = np.sort(rng.uniform(0, 1.4, 15))
    xy = np.c_[np.full(15, 3.0), 40.0 - 20.0 * t] + 0.002 * rng.standard_normal((15, 2))
    J = np.broadcast_to(np.array([[0.02, 0.003], [0.001, 0.05]]), (15, 2, 2))
    config = replace(MOTION, soft=1e9)
    fit = fit_motion(t, xy, J, config, np.ones(15))
    B, n, C = fit.basis(t), 15, fit.coefficients.shape[1]
    span = t[-1] - t[0]
    own = np.r_[1e6, 60.0**2, 0.4**2, np.full(C - 3, 0.2**2 * span / (C - 2))]
    prior = np.diag(np.r_[own * np.r_[1.0, np.full(C - 1, 0.09)], own])
    H = np.zeros((n, 2, 2 * C))
    H[:, 0, :C] = H[:, 1, C:] = B
    H = H.reshape(2 * n, -1)
    pixels = np.kron(error_covariance(t, config, np.ones(n)), np.eye(2))
    wide = np.kron(np.eye(n), J[0])
    S = H @ prior @ H.T + wide @ pixels @ wide.T
    posterior = prior - prior @ H.T @ np.linalg.solve(S, H @ prior)
    row = np.r_[np.zeros(C), fit.basis(np.array(1.0), 1)]
    assert row @ fit.covariance @ row == pytest.approx(row @ posterior @ row, rel=1e-4)


def test_coverage_by_noise_of_stated_size() -> None:
    """Errors drawn from the model that is assumed: 95 % of the intervals hold the truth (240 draws)."""
    rng = np.random.default_rng(2)
    cam, hits, number_of = camera(), 0, 240
    t = np.arange(0.0, 1.2, 0.04)
    root = np.linalg.cholesky(error_covariance(t, MOTION, np.ones(len(t))))
    for _ in range(number_of):
        v, a = 22.0 + 3 * rng.standard_normal(), 0.3 * rng.standard_normal()
        y = 44.0 - v * t + 0.5 * a * t**2
        pixels = see(cam, np.c_[np.full(len(t), 4.0), y]) + root @ rng.standard_normal((len(t), 2))
        vehicle = _one(t, pixels)
        start, end = vehicle.fit.window()
        speed = vehicle.mean_speed(start, end)
        true = 3.6 * (v - 0.5 * a * (start + end))
        hits += speed.low_kmh <= true <= speed.high_kmh
    assert 0.90 <= hits / number_of <= 0.99  # three sigmas of 240 draws below .95, .99 above


def test_a_point_that_stays_behind_does_not_slow_the_vehicle() -> None:
    t = np.arange(0.0, 1.3, 0.02)
    pixels = see(camera(), np.c_[np.full(len(t), 4.0), 44.0 - 20.0 * t])
    pixels[-12:] = pixels[-13]
    vehicle = _one(t, pixels)
    assert vehicle.mean_speed(*vehicle.fit.window()).kmh == pytest.approx(72.0, abs=0.5)
    assert vehicle.fit.window()[1] < t[-10]


@pytest.mark.parametrize("share", [0.3, 0.5, 0.7])
@pytest.mark.parametrize("where", ["begin", "end", "both"])
def test_ends_that_stand_where_no_vehicle_can_stop_are_no_part_of_it(share: float, where: str) -> None:
    """Up to seven in ten points of a track at 72 km/h stay where it begins or ends, also before the edge."""
    rng = np.random.default_rng(7)
    moving = see(camera(), np.c_[np.full(33, 4.0), 44.0 - 0.8 * np.arange(33)])
    count = round(33 * share / (1.0 - share) / (2.0 if where == "both" else 1.0))
    parts = [moving]
    if where != "end":
        parts.insert(0, np.repeat(moving[:1], count, axis=0))
    if where != "begin":
        parts.append(np.repeat(moving[-1:], count, axis=0))
    pixels = np.concatenate(parts)
    pixels += 0.5 * rng.standard_normal(pixels.shape)
    vehicle = _one(0.04 * np.arange(len(pixels)), pixels)
    speed = vehicle.mean_speed(*vehicle.fit.window())
    assert speed.kmh == pytest.approx(72.0, abs=1.0)
    assert speed.low_kmh < 72.0 < speed.high_kmh


def test_a_vehicle_that_brakes_and_stops_is_kept_and_so_is_one_after_a_leap() -> None:
    """Braking with 0.8 g stands within 3 s; and a track that leaps forward at first is slower after it."""
    rng = np.random.default_rng(8)
    t = np.arange(0.0, 6.0, 0.04)
    braking = np.clip(t - 0.5, 0.0, 20.0 / 8.0)
    way = 20.0 * np.minimum(t, 0.5) + 20.0 * braking - 4.0 * braking**2
    pixels = see(camera(), np.c_[np.full(len(t), 4.0), 48.0 - way * 0.8]) + 0.5 * rng.standard_normal(
        (150, 2)
    )
    xy = camera().to_road(pixels)
    assert vehicles_part(t, xy, np.full(len(t), 0.1)) == slice(0, len(t))
    leaps = np.c_[np.full(40, 4.0), np.r_[60.0, 55.0, 50.0, 44.0, 44.0 - 0.6 * np.arange(1, 37)]]
    assert vehicles_part(0.04 * np.arange(40), leaps, np.full(40, 0.05)) == slice(0, 40)


def test_a_standing_vehicle_stands() -> None:
    rng = np.random.default_rng(4)
    t = np.arange(0.0, 20.0, 0.05)
    pixels = see(camera(), np.tile([4.0, 35.0], (len(t), 1))) + 0.5 * rng.standard_normal((len(t), 2))
    speed = _one(t, pixels).mean_speed(0.0, 19.95)
    assert speed.kmh < 0.5
    assert speed.low_kmh == 0.0


def test_height_of_the_point_is_taken_off_and_counted() -> None:
    t = np.arange(0.0, 1.0, 0.02)
    pixels = see(camera(), np.c_[np.full(50, 4.0), 42.0 - 20.0 * t], 0.3)
    known = _one(t, pixels, contact=ContactConfig(0.3, 0.0, 0.0)).mean_speed(0.0, 0.9)
    assert known.kmh == pytest.approx(72.0, abs=0.02)
    doubt = _one(t, pixels, contact=ContactConfig(0.3, 0.08, 0.0)).mean_speed(0.0, 0.9)
    assert doubt.calibration_kmh == pytest.approx(72.0 * 0.08 / 7.7, rel=0.02)


def test_calibration_share_is_what_a_moved_camera_does() -> None:
    cam = camera()
    t = np.arange(0.0, 1.0, 0.02)
    pixels = see(cam, np.c_[np.full(50, 4.0), 42.0 - 20.0 * t])
    sure = np.zeros((12, 12))
    sure[11, 11] = 0.04**2
    speed = _one(t, pixels, replace(cam, covariance=sure)).mean_speed(0.0, 0.9)
    lifted = cam.moved(np.r_[np.zeros(11), 0.04])
    assert speed.calibration_kmh == pytest.approx(
        _one(t, pixels, lifted).mean_speed(0.0, 0.9).kmh - speed.kmh, rel=0.02
    )


def test_thinning_keeps_the_mean() -> None:
    rng = np.random.default_rng(5)
    t, pixels = np.sort(rng.uniform(0, 3, 400)), rng.uniform(0, 100, (400, 2))
    nodes, places, counts = thinned(t, pixels, MOTION)
    assert counts.sum() == 400
    np.testing.assert_allclose(counts @ places / 400, pixels.mean(axis=0))
    np.testing.assert_allclose(counts @ nodes / 400, t.mean())


def test_a_line_is_crossed_when_the_vehicle_is_there() -> None:
    cam = camera()
    t = np.arange(0.0, 1.0, 0.02)
    vehicle = _one(t, see(cam, np.c_[np.full(50, 4.0), 42.0 - 20.0 * t]))
    line = see(cam, np.array([[0.0, 30.0], [8.0, 30.0]])).ravel()
    ends = road_line(cam, tuple(line), 0.0)
    assert ends is not None
    found = crossing(vehicle, ends)
    assert found is not None
    assert found.t == pytest.approx(0.6, abs=1e-3)
    assert found.speed.kmh == pytest.approx(72.0, abs=0.05)
    beside = road_line(cam, tuple(see(cam, np.array([[5.0, 30.0], [8.0, 30.0]])).ravel()), 0.0)
    assert beside is not None
    assert crossing(vehicle, beside) is None


def _across(y: float) -> np.ndarray:
    return np.array([[0.0, y], [8.0, y]])


def test_a_line_shortly_beyond_what_is_seen_whole_is_crossed_too() -> None:
    """Boxes end at y = 22.4 m and the track 1.5 s later: y = 12 is 0.5 s beyond them, y = 1 is 1.1 s."""
    t = np.arange(0.0, 1.0, 0.02)
    vehicle = _one(t, see(camera(), np.c_[np.full(50, 4.0), 42.0 - 20.0 * t]))
    followed = replace(vehicle, t=np.arange(0.0, 2.5, 0.02))
    last = float(vehicle.fit.t[-1])
    found = crossing(followed, _across(42.0 - 20.0 * (last + 0.5)))
    assert found is not None
    assert found.t == pytest.approx(last + 0.5, abs=0.01)
    assert found.speed.kmh == pytest.approx(72.0, abs=0.5)
    assert found.speed.noise_kmh > vehicle.speed_at(0.5).noise_kmh
    assert crossing(vehicle, _across(42.0 - 20.0 * (last + 0.5))) is None  # its track ends before
    assert crossing(followed, _across(42.0 - 20.0 * (last + 1.1))) is None  # too long after its boxes
    before = replace(vehicle, t=np.arange(-1.0, 1.0, 0.02))
    found = crossing(before, _across(42.0 + 20.0 * 0.5))
    assert found is not None
    assert found.t == pytest.approx(-0.5, abs=0.02)


def test_an_end_that_the_fit_does_not_believe_is_not_followed() -> None:
    t = np.arange(0.0, 1.0, 0.02)
    vehicle = _one(t, see(camera(), np.c_[np.full(50, 4.0), 42.0 - 20.0 * t]))
    weight = np.where(vehicle.fit.t > 0.7, 0.0, 1.0)
    astray = replace(vehicle, fit=vehicle.fit._replace(weight=weight), t=np.arange(0.0, 2.5, 0.02))
    assert crossing(astray, _across(30.0)) is not None
    assert crossing(astray, _across(26.0)) is None


@pytest.mark.parametrize(("speed", "turned"), [(-20.0, False), (20.0, False), (-20.0, True), (20.0, True)])
def test_directions_are_those_of_count(speed: float, turned: bool) -> None:
    cam = camera()
    t = np.arange(0.0, 1.0, 0.02)
    pixels = see(cam, np.c_[np.full(50, 4.0), 30.0 + speed * (t - 0.5)])
    line = see(cam, _across(30.0))[:: -1 if turned else 1].ravel()
    ends = road_line(cam, tuple(line), 0.0)
    assert ends is not None
    found = crossing(_one(t, pixels), ends)
    assert found is not None
    nowhere = np.full((50, 6), np.nan)
    mean = np.c_[pixels, np.zeros((50, 4))]
    boxes = np.c_[pixels - 5.0, np.full((50, 2), 10.0)]
    table = Trajectories(
        t, np.ones(50, dtype=np.int64), boxes, np.ones(50), mean, nowhere, np.ones(50, dtype=np.int64)
    )
    (counted,) = crossings(table, Line(*line.tolist()))
    assert found.direction == counted.direction
    assert found.t == pytest.approx(counted.t, abs=0.01)


def test_lanes_are_where_vehicles_drive() -> None:
    rng = np.random.default_rng(6)
    x = np.concatenate([-1.8 + 0.3 * rng.standard_normal(200), 1.9 + 0.3 * rng.standard_normal(90)])
    velocity = np.stack([0.5 * rng.standard_normal(290), np.where(x < 0.0, -25.0, 25.0)], axis=1)
    lanes = find_lanes(x, velocity, LaneConfig())
    assert lanes.names == ("1", "2")
    np.testing.assert_allclose(lanes.middle, [-1.8, 1.9], atol=0.15)
    assert list(lanes.of(np.array([-2.0, 1.5, 9.0]))) == ["1", "2", ""]


def test_where_many_drive_across_there_are_no_lanes() -> None:
    """A junction: two ways along the road, two across it, and turns between them."""
    rng = np.random.default_rng(7)
    x = np.concatenate([-1.8 + 0.3 * rng.standard_normal(50), 1.9 + 0.3 * rng.standard_normal(50)])
    along = np.stack([np.zeros(100), np.full(100, 12.0)], axis=1)
    turns = rng.uniform(-1.0, 1.0, (60, 2)) * 10.0
    places = np.concatenate([x, rng.uniform(-20, 20, 60)])
    found = find_lanes(places, np.concatenate([along, turns]), LaneConfig())
    assert found.names == ()
    assert find_lanes(x, along, LaneConfig()).names == ("1", "2")
    assert find_lanes(np.zeros(0), np.zeros((0, 2)), LaneConfig()).names == ()


def test_vehicles_anywhere_across_the_road_show_no_lanes_of_their_own() -> None:
    x = np.random.default_rng(8).uniform(-9.0, 9.0, 2000)
    lanes = find_lanes(x, np.tile((0.0, 20.0), (2000, 1)), LaneConfig())
    assert len(lanes.names) <= 1


def test_a_speed_of_which_next_to_nothing_is_known_is_not_reported() -> None:
    assert reported_speed(interval(80.0, 5.0, 1.0)) == interval(80.0, 5.0, 1.0)
    assert reported_speed(interval(0.0, 4.0, 0.0)).kmh == 0.0
    assert math.isnan(reported_speed(interval(78.8, 100.0, 0.0)).kmh)
    assert math.isnan(reported_speed(interval(3.0, 8.0, 0.0)).low_kmh)


def test_all_of_many_vehicles_are_unbiased() -> None:
    rng, cam = np.random.default_rng(7), camera()
    t, track, pixels, true = drives(cam, rng, 30, 0.5)
    errors = []
    for k in range(30):
        rows = track == k
        if rows.sum() > 20:
            vehicle = _one(t[rows], pixels[rows])
            errors.append(vehicle.mean_speed(*vehicle.fit.window()).kmh - 3.6 * true[k])
    assert abs(np.mean(errors)) < 0.15


def test_the_error_of_a_crossing_time_is_what_it_says() -> None:
    """Errors drawn from the model: the times at a slanting line scatter as `sigma_t` says (100 draws)."""
    rng, cam = np.random.default_rng(5), camera()
    t = np.arange(0.0, 1.2, 0.04)
    root = np.linalg.cholesky(error_covariance(t, MOTION, np.ones(len(t))))
    ends = np.array([[-10.0, 25.0], [20.0, 35.0]])
    true = (44.0 - (25.0 + 14.0 / 3.0)) / 22.0
    pixels = see(cam, np.c_[np.full(len(t), 4.0), 44.0 - 22.0 * t])
    z = []
    for _ in range(100):
        found = crossing(_one(t, pixels + root @ rng.standard_normal((len(t), 2))), ends)
        assert found is not None
        z.append((found.t - true) / found.sigma_t)
    assert 0.79 < np.std(z) < 1.21  # three standard deviations of that of 100 draws
