"""What evidence says of a camera: clicks count once, and a scene's size is known by what was measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose
from road_scenes import HEIGHT, WIDTH, camera, drives, see

from jeat_graph.road.calibrate import calibrate
from jeat_graph.road.evidence import CalibrationConfig, Lengths, thin
from jeat_graph.road.lane_spacing import comb_pitch
from jeat_graph.road.length_evidence import length_covariance, length_errors, length_residuals
from jeat_graph.road.residuals import Problem, Weighting, track_residuals
from jeat_graph.road.track_fit import fit_tracks, track_scale

CLICKS_ALONE = CalibrationConfig(length_sd_m=1e-6, along_sd_rad=1e-4, across_sd_rad=1e-4)


def _lengths(ends: np.ndarray) -> Lengths:
    """Lengths along the road between places (L, 2, 2) in m, seen without error."""
    pixels = see(camera(), ends)
    return Lengths(
        pixels[:, 0], pixels[:, 1], np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), np.full(len(ends), True)
    )


def test_two_lengths_end_to_end_are_together_as_good_as_one_long_length() -> None:
    places = np.array([[3.0, 18.0], [3.0, 26.0], [3.0, 44.0]])
    parts = _lengths(np.stack([places[:2], places[1:]]))
    whole = _lengths(places[None, [0, 2]])
    both = length_covariance(camera(), parts, CLICKS_ALONE)
    one = length_covariance(camera(), whole, CLICKS_ALONE)
    total = np.array([1.0, 0.0, 1.0, 0.0])
    assert_allclose(total @ both @ total, one[0, 0], rtol=1e-6)
    assert both[0, 2] < 0.0


def test_clicks_apart_err_apart() -> None:
    apart = _lengths(np.array([[[3.0, 18.0], [3.0, 26.0]], [[6.0, 18.0], [6.0, 26.0]]]))
    covariance = length_covariance(camera(), apart, CLICKS_ALONE)
    assert_allclose(covariance[:2, 2:], 0.0, atol=1e-15)


def test_covariance_of_lengths_is_that_of_drawn_clicks() -> None:
    rng, cam = np.random.default_rng(4), camera()
    places = np.array([[3.0, 18.0], [3.0, 26.0], [3.0, 44.0]])
    exact = _lengths(np.stack([places[:2], places[1:]]))
    clicks = see(cam, places) + CLICKS_ALONE.click_px * rng.standard_normal((4000, 3, 2))
    errors = np.array([length_errors(cam, replace(exact, start=p[:2], end=p[1:])).ravel() for p in clicks])
    want = length_covariance(cam, exact, CLICKS_ALONE)
    # The spread of a variance from 4,000 draws is 2.2 %; four of them.
    size = np.sqrt(np.diag(want))
    assert_allclose(np.cov(errors.T) / np.outer(size, size), want / np.outer(size, size), atol=0.09)
    white = np.array([length_residuals(cam, replace(exact, start=p[:2], end=p[1:]), want) for p in clicks])
    assert_allclose(white.var(axis=0), 1.0, atol=0.09)


def test_what_tracks_cost_does_not_depend_on_the_size_of_the_scene() -> None:
    """The same pixels through a camera half as high: a road half as large, and the same residuals."""
    cam, rng = camera(), np.random.default_rng(5)
    t, track, pixels, _ = drives(cam, rng, 12, 0.5)
    config = CalibrationConfig()
    problem = Problem(WIDTH, HEIGHT, None, None, thin(t, track, pixels, config, (WIDTH, HEIGHT)), config)
    assert problem.tracks is not None
    weight = np.ones(problem.tracks.t.shape)
    weighting = Weighting(np.zeros((0, 0)), 1.0, 1.5, 1.0, weight, scene=track_scale(cam, problem.tracks))
    half = replace(cam, position=0.5 * cam.position)
    want = track_residuals(cam, problem, weighting, 0.05)
    assert np.abs(want).max() > 0.1
    assert_allclose(track_residuals(half, problem, weighting, 0.05), want, rtol=1e-4, atol=1e-5)


def test_weaving_vehicles_do_not_make_lanes_narrow() -> None:
    """Two lengths along the road: across it, lanes tell the scale, however much the vehicles drift."""
    cam, rng = camera(), np.random.default_rng(6)
    t, track, pixels, _ = drives(cam, rng, 60, 0.3, drift=0.6)
    config = CalibrationConfig(most_tracks=40)
    tracks = thin(t, track, pixels, config, (WIDTH, HEIGHT))
    given = _lengths(np.array([[[0.5, 18.0], [0.5, 44.0]], [[8.0, 17.0], [8.0, 45.0]]]))
    found = calibrate(Problem(WIDTH, HEIGHT, given, None, tracks, config))
    w = found.weighting
    assert w.lanes is not None
    x = fit_tracks(found.camera, tracks, config, w.track_px, 0.0, w.node_weight).motion[:, 0]
    assert abs(np.log(comb_pitch(x, w.lanes) / config.lane_m)) < config.lane_log_sd
