"""Calibration: finds the camera that made the evidence, and says honestly how well."""

from __future__ import annotations

import numpy as np
import pytest
from road_scenes import HEIGHT, WIDTH, camera, drives, lengths, see

from jeat_graph.data.errors import DataError
from jeat_graph.road.calibrate import calibrate
from jeat_graph.road.evidence import CalibrationConfig, Points, TrackNodes, thin
from jeat_graph.road.lane_spacing import comb_pitch, find_comb
from jeat_graph.road.residuals import Problem
from jeat_graph.road.track_fit import fit_tracks
from jeat_graph.road.vanishing import vanishing_point

CONFIG = CalibrationConfig(most_tracks=40)
PLACES = np.array([[2.5, 18.0], [6.0, 22.0], [2.5, 40.0], [6.0, 44.0], [4.0, 30.0]])


def _problem(seed: int, noise: float, click_px: float, tape_m: float, vehicles: int = 40) -> Problem:
    rng = np.random.default_rng(seed)
    cam = camera()
    t, track, pixels, _ = drives(cam, rng, vehicles, noise)
    tracks = thin(t, track, pixels, CONFIG, (WIDTH, HEIGHT))
    return Problem(WIDTH, HEIGHT, lengths(cam, rng, click_px, tape_m), None, tracks, CONFIG)


def test_vanishing_point_is_where_the_road_ends() -> None:
    cam, rng = camera(k1=0.0), np.random.default_rng(0)
    t, track, pixels, _ = drives(cam, rng, 30, 0.3, drift=0.01)
    nodes = thin(t, track, pixels, CONFIG, (WIDTH, HEIGHT))
    bogus = rng.uniform(0, 1000, (6, 1, 2)) + np.linspace(0, 1, CONFIG.nodes)[:, None] * rng.uniform(
        -400, 400, (6, 1, 2)
    )
    point = vanishing_point(np.concatenate([nodes.pixels, bogus]))
    want = cam.project(np.array([0.0, 1e7, 0.0]))[0]
    assert point is not None
    assert np.linalg.norm(point - want) < 15.0


def test_good_evidence_gives_the_camera_back() -> None:
    found = calibrate(_problem(1, 0.1, 0.05, 0.001)).camera
    pixels = see(camera(), PLACES)
    seen, want = found.to_road(pixels), PLACES
    stretch = np.linalg.norm(seen[2] - seen[0]) / np.linalg.norm(want[2] - want[0])
    assert stretch == pytest.approx(1.0, abs=0.004)
    assert found.position[2] == pytest.approx(8.0, abs=0.15)
    assert found.fx == pytest.approx(2600.0, rel=0.03)


@pytest.mark.slow
def test_scale_error_is_within_its_spread() -> None:
    """Monte Carlo: the error of a distance over its stated standard deviation is of size one."""
    ratios = []
    for seed in range(4):
        found = calibrate(_problem(seed, 0.6, 2.0, 0.08, vehicles=12)).camera
        pixels = see(camera(), PLACES[[0, 2]])
        J = found.calibration_jacobian(pixels)
        gradient = J[1, 1] - J[0, 1]
        spread = np.sqrt(gradient @ found.covariance @ gradient)
        seen = found.to_road(pixels)
        ratios.append((seen[1, 1] - seen[0, 1] - 22.0) / spread)
    size = np.sqrt(np.mean(np.square(ratios)))
    assert 0.15 < size < 2.15  # the 0.1 % and 99.9 % points of a chi with four degrees of freedom


def test_surveyed_points_place_the_camera_on_the_map() -> None:
    cam, rng = camera(), np.random.default_rng(3)
    places = np.c_[rng.uniform(-4, 10, 12), rng.uniform(16, 60, 12)]
    bearing = 0.6
    c, s = np.cos(bearing), np.sin(bearing)
    on_map = np.c_[4.5e5 + c * places[:, 0] + s * places[:, 1], 5.4e6 - s * places[:, 0] + c * places[:, 1]]
    pixels = see(cam, places) + 0.2 * rng.standard_normal((12, 2))
    t, track, track_pixels, _ = drives(cam, rng, 20, 0.3)
    tracks = thin(t, track, track_pixels, CONFIG, (WIDTH, HEIGHT))
    found = calibrate(Problem(WIDTH, HEIGHT, None, Points(pixels, on_map), tracks, CONFIG), "33N").camera
    assert found.georeference is not None
    assert found.georeference.bearing_rad == pytest.approx(bearing, abs=0.01)
    test = np.array([[3.0, 30.0], [6.0, 50.0]])
    want = np.c_[4.5e5 + c * test[:, 0] + s * test[:, 1], 5.4e6 - s * test[:, 0] + c * test[:, 1]]
    got = found.georeference.to_map(found.to_road(see(cam, test)))
    assert np.abs(got - want).max() < 0.3


def test_without_scale_there_is_no_camera() -> None:
    with pytest.raises(DataError, match="scale"):
        calibrate(Problem(WIDTH, HEIGHT, None, None, None, CONFIG))


def test_lanes_are_a_comb_whose_pitch_is_found() -> None:
    rng = np.random.default_rng(8)
    x = 1.3 + 2.9 * rng.integers(0, 3, 60) + 0.2 * rng.standard_normal(60)
    comb = find_comb(x, np.ones(60))
    assert comb is not None
    assert comb_pitch(x, comb) == pytest.approx(2.9, abs=0.1)
    assert find_comb(rng.uniform(0.0, 12.0, 400), np.ones(400)) is None


def test_tracks_alone_tell_a_scale_by_their_lanes() -> None:
    """Nothing measured at all: the scale is that of lanes 3.6 m apart, and is said to be no surer."""
    given = _problem(3, 0.3, 1.0, 0.02)
    assert given.tracks is not None
    few = TrackNodes(given.tracks.t[::3], given.tracks.pixels[::3])
    found = calibrate(Problem(WIDTH, HEIGHT, None, None, few, CONFIG))
    w = found.weighting
    assert w.lanes is not None
    x = fit_tracks(found.camera, few, CONFIG, w.track_px, 0.0, w.node_weight).motion[:, 0]
    assert comb_pitch(x, w.lanes) == pytest.approx(3.6, rel=0.03)
    assert np.sqrt(found.camera.covariance[11, 11]) > 0.04 * found.camera.position[2]


def test_a_measured_width_leaves_the_lanes_out() -> None:
    assert not _problem(3, 0.3, 1.0, 0.02).needs_lanes
