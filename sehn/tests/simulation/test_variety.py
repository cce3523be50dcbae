"""Drawn worlds keep what a scenario asks for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from jeat_graph_sehn.simulation.imaging.config import ImagingConfig
from jeat_graph_sehn.simulation.scenario import load_scenario
from jeat_graph_sehn.simulation.variety import _edge_m, _traffic, vary


def test_at_least_as_many_stop_as_the_scenario_says() -> None:
    """Nothing else changes: the same random numbers are drawn."""
    plain = load_scenario("day")
    halting = replace(plain.traffic, stopped=3)
    for seed in range(20):
        drawn = _traffic(np.random.default_rng(seed), plain.traffic, plain.road)
        asked = _traffic(np.random.default_rng(seed), halting, plain.road)
        assert asked.stopped == max(drawn.stopped, 3)
        assert replace(asked, stopped=drawn.stopped) == drawn


def test_near_a_road_the_camera_stands_beside_it_and_looks_across() -> None:
    """Road and light are those of the same draw of a varied world, without walls before the camera."""
    sides = set()
    for seed in range(20):
        plain = load_scenario("day")
        near, imaging, around = vary(np.random.default_rng(seed), plain, ImagingConfig(), near=True)
        far, far_imaging, _ = vary(np.random.default_rng(seed), plain, ImagingConfig())
        assert (near.road, near.light, imaging) == (far.road, far.light, far_imaging)
        assert around.noise_left_m == around.noise_right_m == 0.0
        camera = near.camera
        side = np.sign(camera.offset_m)
        assert abs(camera.offset_m) > _edge_m(near.road)
        assert np.sign(camera.yaw_deg) == -side
        assert camera.mount_height_m < 5.0
        sides.add(side)
    assert sides == {-1.0, 1.0}
