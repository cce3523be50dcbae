"""Boxes of cuboids: the model against corners projected one by one, and vehicles found again by boxes."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from road_scenes import camera

from jeat_graph.road.box_channels import HIGH, LOW, NEITHER, WHOLE, directions, linearise, measured
from jeat_graph.road.box_errors import BoxRows, robust_weights, whiten
from jeat_graph.road.box_rows import BoxConfig, rows_of_table
from jeat_graph.road.boxes_road import class_by_length
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.cuboid import sides
from jeat_graph.road.cuboid_fit import CuboidConfig, CuboidFit, fit_cuboid
from jeat_graph.road.fleet import CLASSES
from jeat_graph.road.motion_fit import MotionFitConfig
from jeat_graph.road.speeds import Vehicle

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


def _way(heading: np.ndarray) -> np.ndarray:
    return np.stack([np.sin(heading), np.cos(heading)], axis=1)


def test_compiled_sides_are_those_of_the_plain_model() -> None:
    """With one side of each axis measured, the channels are that side."""
    rng, cam, n = np.random.default_rng(3), camera(k2=0.01), 20
    xy, heading = rng.uniform([-8.0, 20.0], [8.0, 90.0], (n, 2)), rng.uniform(-3.0, 3.0, n)
    size = np.array([rng.uniform(2, 16), rng.uniform(0.8, 2.6), rng.uniform(1.3, 4.0)])
    expected, J = sides(cam, xy, heading, size)
    for mode, first in ((LOW, 0), (HIGH, 2)):
        found = linearise(
            cam.compiled(), xy, _way(heading), size, np.zeros((n, 4)), np.full((n, 2), mode, dtype=np.int64)
        )
        assert found is not None
        slopes, residual = found
        np.testing.assert_allclose(-residual[:, :2], expected[:, first : first + 2], rtol=1e-12)
        np.testing.assert_allclose(slopes[:, :2], J[:, first : first + 2], rtol=1e-9, atol=1e-9)
        assert not slopes[:, 2:].any()
        assert not residual[:, 2:].any()


def test_channels_of_a_whole_box_are_its_middle_and_the_logarithm_of_its_size() -> None:
    cam, size, mode = camera(), np.array([4.5, 1.8, 1.5]), np.array([[WHOLE, WHOLE], [WHOLE, NEITHER]])
    xy, heading = np.array([[3.0, 32.0], [-2.0, 50.0]]), np.array([0.05, -0.2])
    (left, top, right, bottom), J = (values[0] for values in sides(cam, xy, heading, size))
    z = np.full((2, 4), 7.0)
    found = linearise(cam.compiled(), xy, _way(heading), size, z, mode)
    assert found is not None
    slopes, residual = found
    expected = np.array([(left + right) / 2, (top + bottom) / 2, np.log(right - left), np.log(bottom - top)])
    np.testing.assert_allclose(7.0 - residual[0], expected, rtol=1e-12)
    np.testing.assert_allclose(slopes[0, 0], (J[0] + J[2]) / 2.0, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(slopes[0, 3], (J[3] - J[1]) / (bottom - top), rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(slopes[1, [1, 3]], 0.0)
    np.testing.assert_array_equal(residual[1, [1, 3]], 7.0)


@pytest.mark.parametrize("xy", [(0.0, -5.0), (0.0, np.nan)])
def test_what_is_not_before_the_camera_has_no_channels(xy: tuple[float, float]) -> None:
    place, mode = np.array([[3.0, 32.0], xy]), np.zeros((2, 2), dtype=np.int64)
    way = np.array([[0.0, 1.0], [0.0, 1.0]])
    size = np.array([4.5, 1.8, 1.5])
    assert linearise(camera().compiled(), place, way, size, np.zeros((2, 4)), mode) is None


def test_who_hardly_moves_faces_along_the_road() -> None:
    velocity = np.array([[3.0, 4.0], [0.0, -0.5], [0.0, 0.0]])
    found = directions(velocity, np.pi / 6.0, 1.0)
    np.testing.assert_allclose(found, [[0.6, 0.8], *[[0.5, np.sqrt(0.75)]] * 2], rtol=1e-15)


def test_a_weight_is_that_of_the_mean_of_the_channels_that_count() -> None:
    """All channels off by twice their standard deviation, soft 2: a quarter; the cut one does not count."""
    mode = np.array([[WHOLE, WHOLE], [WHOLE, NEITHER], [NEITHER, NEITHER]])
    white, coloured = np.full((3, 4), 9.0), np.full((3, 4), 4.0)
    rows = BoxRows(np.arange(3.0), np.zeros((3, 4)), white, coloured, mode, np.zeros(3, int), np.ones(1))
    residual = np.array([[10.0, -10.0, 10.0, 10.0], [10.0, 1e9, -10.0, np.inf], [1.0, 2.0, 3.0, 4.0]])
    np.testing.assert_array_equal(measured(mode).sum(axis=1), [4.0, 2.0, 0.0])
    np.testing.assert_allclose(robust_weights(residual, rows, 2.0), [0.25, 0.25, 1.0])


def test_whitening_is_the_inverse_root_of_the_dense_covariance() -> None:
    """The filter's innovations against Cholesky: same quadratic forms, same determinant."""
    rng, n = np.random.default_rng(4), 30
    t, group = np.sort(rng.uniform(0, 3, n)), rng.integers(0, 2, n)
    memory = np.array([0.2, 0.7])
    white, coloured = rng.uniform(0.5, 2.0, (n, 4)), rng.uniform(0.5, 2.0, (n, 4))
    mode = np.zeros((n, 2), dtype=np.int64)
    rows = BoxRows(t, np.zeros((n, 4)), white, coloured, mode, group, memory)
    columns = rng.standard_normal((n, 4, 3))
    weight = rng.uniform(0.3, 1.0, n)
    got = columns.copy()
    log_determinant, expected = whiten(got, rows, weight), 0.0
    for channel in range(4):
        apart = np.exp(-np.abs(t[:, None] - t) / memory[group][:, None])
        h, total = coloured[:, channel], white[:, channel] + coloured[:, channel] ** 2
        cov = np.where(group[:, None] == group, h[:, None] * h * apart, 0.0)
        cov += np.diag(white[:, channel] + total * (1.0 / weight - 1.0))
        expected += np.linalg.slogdet(cov)[1]
        form = columns[:, channel].T @ np.linalg.solve(cov, columns[:, channel])
        np.testing.assert_allclose(got[:, channel].T @ got[:, channel], form, rtol=1e-9, atol=1e-12)
    assert log_determinant == pytest.approx(expected, rel=1e-9)


def _fit(t: np.ndarray, boxes: np.ndarray, cam: RoadCamera, config: CuboidConfig) -> CuboidFit | None:
    rows = rows_of_table(t, boxes, np.zeros((len(t), 4)), (cam.width, cam.height), BoxConfig())
    return fit_cuboid(rows, cam, config, MOTION)


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
    found = _fit(t, boxes, camera(), CuboidConfig())
    assert found is not None
    assert CLASSES[found.kind].name == kind
    np.testing.assert_allclose(found.size, size, atol=3.0 * np.sqrt(np.diag(found.size_covariance)).max())
    place = found.motion.at(t)
    assert np.abs(place[:, 0] - 3.0).max() < 0.2
    assert np.abs(place[:, 1] - (60.0 - 22.0 * t)).max() < 1.0
    assert found.motion.at(np.array(0.8), 1)[1] == pytest.approx(-22.0, abs=0.3)


def test_sides_cut_by_the_picture_do_not_count() -> None:
    t, boxes = _drive((4.5, 1.8, 1.5), np.random.default_rng(1), 0.2)
    whole = _fit(t, boxes, camera(), CuboidConfig())
    cut = boxes.copy()
    right = cut[:, 0] + cut[:, 2]
    cut[:, 0] = np.maximum(cut[:, 0], 0.0)
    cut[:8, 2] = right[:8] - 0.0
    cut[:8, 0] = 0.0  # the left edge of the picture hides the left part of the first eight
    found = _fit(t, cut, camera(), CuboidConfig())
    assert whole is not None
    assert found is not None
    assert np.abs(found.motion.at(t) - whole.motion.at(t)).max() < 1.0


def test_calibration_moves_a_vehicle_as_predicted() -> None:
    t, boxes = _drive((4.5, 1.8, 1.5), np.random.default_rng(2), 0.0)
    spread = np.zeros((12, 12))
    spread[11, 11] = 0.05**2
    cam = replace(camera(), covariance=spread)
    found = _fit(t, boxes, cam, CuboidConfig(soft=1e6))
    lifted = _fit(t, boxes, cam.moved(np.r_[np.zeros(11), 0.05]), CuboidConfig(soft=1e6))
    assert found is not None
    assert lifted is not None
    row = np.r_[np.zeros(found.motion.coefficients.shape[1]), found.motion.basis(np.array(0.8), 1)]
    moved = lifted.motion.at(np.array(0.8), 1)[1] - found.motion.at(np.array(0.8), 1)[1]
    assert np.sqrt(row @ found.by_calibration @ row) == pytest.approx(abs(moved), rel=0.1)


@pytest.mark.parametrize("y", [40.0, 80.0])
def test_a_standing_vehicle_has_no_speed(y: float) -> None:
    """Its boxes jitter, some of it persisting; over its whole track it still stands, to half a km/h."""
    rng, t = np.random.default_rng(int(y)), np.arange(0.0, 12.0, 0.1)
    seen, _ = sides(camera(), np.tile([3.0, y], (len(t), 1)), np.zeros(len(t)), np.array([4.5, 1.8, 1.5]))
    drift = np.cumsum(rng.standard_normal(seen.shape), axis=0) * 0.05
    seen = seen + 0.4 * rng.standard_normal(seen.shape) + drift - drift.mean(axis=0)
    found = _fit(t, np.c_[seen[:, :2], seen[:, 2:] - seen[:, :2]], camera(), CuboidConfig())
    assert found is not None
    vehicle = Vehicle(1, t, found.motion, found.by_calibration, 0.0, 0.0)
    assert vehicle.mean_speed(*found.motion.window()).kmh < 0.5


def test_what_no_vehicle_is_as_small_as_is_no_vehicle() -> None:
    """Boxes of a thing of 1.3 m that stands there make none; a car with a trailer and a bicycle do."""
    cam, t = camera(), np.arange(0.0, 2.0, 0.05)
    for size, speed, found in (
        ((1.3, 0.5, 0.55), 0.0, False),
        ((9.0, 1.9, 1.6), 20.0, True),
        ((1.9, 0.65, 1.6), 6.0, True),
    ):
        xy = np.c_[np.full(len(t), 1.0), 25.0 + speed * t]
        box = sides(cam, xy, np.zeros(len(t)), np.array(size))[0]
        boxes = np.c_[box[:, :2], box[:, 2:] - box[:, :2]]
        rows = rows_of_table(t, boxes, np.zeros((len(t), 4)), (cam.width, cam.height), BoxConfig())
        assert (fit_cuboid(rows, cam, CuboidConfig(), MOTION) is not None) is found, size


@pytest.mark.parametrize(("share", "name"), [(0.1, "truck"), (0.49, "truck"), (0.6, ""), (1.0, "")])
def test_a_class_is_reported_where_the_boxes_tell_the_length_better_than_the_class_does(share, name) -> None:
    kind = max(range(len(CLASSES)), key=lambda k: CLASSES[k].mean[0])
    mean, spread = np.array(CLASSES[kind].mean), np.array(CLASSES[kind].spread)
    fit = CuboidFit(None, np.zeros((0, 0)), kind, mean, np.diag(share * spread**2), 1.0)
    assert class_by_length(fit) == name
