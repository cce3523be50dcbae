"""Boxes of cuboids: the model against corners projected one by one, and vehicles found again by boxes."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from road_scenes import camera

from jeat_graph.road.cuboid import sides
from jeat_graph.road.cuboid_fit import CLASSES, CuboidConfig, fit_cuboid
from jeat_graph.road.motion_fit import MotionFitConfig

MOTION = MotionFitConfig(acceleration_sd=0.8, jerk=0.3)


def _hull(xy: tuple[float, float], heading: float, size: tuple[float, float, float]) -> np.ndarray:
    cam, seen = camera(), []
    for a, b, top in product((-0.5, 0.5), (-0.5, 0.5), (0.0, 1.0)):
        ahead = np.array([np.sin(heading), np.cos(heading), 0.0]) * a * size[0]
        beside = np.array([np.cos(heading), -np.sin(heading), 0.0]) * b * size[1]
        seen.append(cam.project(np.array([*xy, 0.0]) + ahead + beside + [0.0, 0.0, top * size[2]])[0])
    return np.concatenate([np.min(seen, axis=0), np.max(seen, axis=0)])


def test_sides_are_the_outermost_corners() -> None:
    cases = [((3.0, 30.0), 0.0), ((-4.0, 25.0), 0.1), ((8.0, 60.0), -0.3)]
    for xy, heading in cases:
        got, _ = sides(camera(), np.array([xy]), np.array([heading]), np.array([4.5, 1.8, 1.5]))
        np.testing.assert_allclose(got[0], _hull(xy, heading, (4.5, 1.8, 1.5)), atol=1e-9)


def test_derivatives_are_finite_differences() -> None:
    cam, h = camera(), 1e-5
    xy, heading, size = np.array([[3.0, 32.0]]), np.array([0.05]), np.array([4.5, 1.8, 1.5])
    _, J = sides(cam, xy, heading, size)
    for k in range(5):
        d = np.eye(5)[k] * h
        up, down = (sides(cam, xy + s * d[None, :2], heading, size + s * d[2:])[0][0] for s in (1, -1))
        np.testing.assert_allclose(J[0, :, k], (up - down) / (2 * h), rtol=1e-5, atol=1e-4)


def _drive(
    size: tuple[float, float, float], rng: np.random.Generator, noise: float
) -> tuple[np.ndarray, np.ndarray]:
    t = np.arange(0.0, 1.6, 0.05)
    xy = np.c_[np.full(len(t), 3.0), 60.0 - 22.0 * t]
    seen, _ = sides(camera(), xy, np.zeros(len(t)), np.array(size))
    seen = seen + noise * rng.standard_normal(seen.shape)
    return t, np.c_[seen[:, :2], seen[:, 2:] - seen[:, :2]]


@pytest.mark.parametrize(
    ("size", "kind"),
    [((4.5, 1.8, 1.5), "car"), ((5.7, 2.0, 2.5), "van"), ((14.0, 2.5, 3.8), "truck")],
)
def test_a_vehicle_is_found_again_with_its_kind(size: tuple[float, float, float], kind: str) -> None:
    t, boxes = _drive(size, np.random.default_rng(0), 0.3)
    found = fit_cuboid(t, boxes, camera(), CuboidConfig(), MOTION)
    assert found is not None
    assert CLASSES[found.kind].name == kind
    np.testing.assert_allclose(found.size, size, atol=3.0 * np.sqrt(np.diag(found.size_covariance)).max())
    place = found.motion.at(t)
    assert np.abs(place[:, 0] - 3.0).max() < 0.2
    assert np.abs(place[:, 1] - (60.0 - 22.0 * t)).max() < 1.0
    assert found.motion.at(np.array(0.8), 1)[1] == pytest.approx(-22.0, abs=0.3)


def test_sides_cut_by_the_picture_do_not_count() -> None:
    t, boxes = _drive((4.5, 1.8, 1.5), np.random.default_rng(1), 0.2)
    whole = fit_cuboid(t, boxes, camera(), CuboidConfig(), MOTION)
    cut = boxes.copy()
    right = cut[:, 0] + cut[:, 2]
    cut[:, 0] = np.maximum(cut[:, 0], 0.0)
    cut[:8, 2] = right[:8] - 0.0
    cut[:8, 0] = 0.0  # the left edge of the picture hides the left part of the first eight
    found = fit_cuboid(t, cut, camera(), CuboidConfig(), MOTION)
    assert whole is not None
    assert found is not None
    assert np.abs(found.motion.at(t) - whole.motion.at(t)).max() < 1.0


def test_calibration_moves_a_vehicle_as_foretold() -> None:
    t, boxes = _drive((4.5, 1.8, 1.5), np.random.default_rng(2), 0.0)
    spread = np.zeros((12, 12))
    spread[11, 11] = 0.05**2
    cam = replace(camera(), covariance=spread)
    found = fit_cuboid(t, boxes, cam, CuboidConfig(soft=1e6), MOTION)
    lifted = fit_cuboid(t, boxes, cam.moved(np.r_[np.zeros(11), 0.05]), CuboidConfig(soft=1e6), MOTION)
    assert found is not None
    assert lifted is not None
    row = np.r_[np.zeros(found.motion.coefficients.shape[1]), found.motion.basis(np.array(0.8), 1)]
    moved = lifted.motion.at(np.array(0.8), 1)[1] - found.motion.at(np.array(0.8), 1)[1]
    assert np.sqrt(row @ found.by_calibration @ row) == pytest.approx(abs(moved), rel=0.1)
