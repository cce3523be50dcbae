"""Intervals of many wrong cameras hold as often as they say; those of one camera hold nearly all, or few."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from road_scenes import camera

from jeat_graph.road.camera import PARAMETERS
from jeat_graph.road.report import speed_share

SPREAD = {"log_f": 0.006, "turn_x": 0.0012, "turn_y": 0.002, "turn_z": 0.004, "z": 0.03}
SD = np.array([SPREAD.get(name, 0.0) for name in PARAMETERS])
KMH, NOISE_KMH = 90.0, 0.35


def test_a_calibration_is_one_draw_for_all_vehicles_of_a_camera() -> None:
    rng, true = np.random.default_rng(5), camera()
    x = np.tile([1.0, 4.5, 8.0], 40)  # vehicles in three lanes
    ends = [np.c_[x, np.full(len(x), y), np.zeros(len(x))] for y in (23.75, 36.25)]
    pixels = [true.project(one)[0] for one in ends]
    held = []
    for _ in range(300):
        wrong = replace(true.moved(SD * rng.standard_normal(len(SD))), covariance=np.diag(SD**2))
        way = np.linalg.norm(wrong.to_road(pixels[1]) - wrong.to_road(pixels[0]), axis=1)
        kmh = KMH * way / 12.5 + NOISE_KMH * rng.standard_normal(len(x))
        share = {lane: speed_share(wrong, lane, 30.0) for lane in np.unique(x).tolist()}
        sigma = np.hypot(KMH * np.array([share[lane] for lane in x.tolist()]), NOISE_KMH)
        held.append(100.0 * (np.abs(kmh - KMH) <= 1.96 * sigma).mean())
    each = np.array(held)
    assert 93.0 < each.mean() < 97.0  # over all cameras: honest
    between = 100.0 * ((each >= 90.0) & (each <= 98.0)).mean()
    assert between < 50.0  # of one camera: seldom near 95
    assert 100.0 * (each > 98.0).mean() > 50.0
