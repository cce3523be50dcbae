"""Projection against closed forms worked out by hand."""

import numpy as np
import pytest

from jeat_graph_sehn.simulation.world.camera import Camera, CameraConfig

LEVEL = Camera.mounted(CameraConfig(pitch_deg=0.0, offset_m=0.0, mount_height_m=7.0))
TILTED = Camera.mounted(CameraConfig(pitch_deg=14.0, offset_m=1.0, yaw_deg=5.0))


def test_a_level_camera_projects_by_similar_triangles() -> None:
    pixel, depth = LEVEL.project(np.array([3.0, 50.0, 1.0]))
    assert depth == pytest.approx(50.0)
    assert pixel == pytest.approx([640.0 + 1100.0 * 3.0 / 50.0, 360.0 + 1100.0 * 6.0 / 50.0])


def test_the_optical_axis_of_a_pitched_camera_meets_the_road_at_height_over_tangent() -> None:
    camera = Camera.mounted(CameraConfig(pitch_deg=20.0, offset_m=2.0, mount_height_m=8.0))
    pixel, _ = camera.project(np.array([2.0, 8.0 / np.tan(np.radians(20.0)), 0.0]))
    assert pixel == pytest.approx([640.0, 360.0])


def test_the_horizon_lies_above_the_centre_by_the_tangent_of_the_pitch() -> None:
    camera = Camera.mounted(CameraConfig(pitch_deg=14.0))
    pixel, _ = camera.project(np.array([1.0, 1e9, 0.0]))
    assert pixel[1] == pytest.approx(360.0 - 1100.0 * np.tan(np.radians(14.0)), abs=1e-4)


def test_the_rotation_is_a_rotation() -> None:
    assert TILTED.rotation @ TILTED.rotation.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(TILTED.rotation) == pytest.approx(1.0)


def test_the_jacobian_agrees_with_central_differences() -> None:
    point, h = np.array([-4.0, 33.0, 1.2]), 1e-5
    steps = h * np.eye(3)
    numeric = np.stack(
        [(TILTED.project(point + s)[0] - TILTED.project(point - s)[0]) / (2 * h) for s in steps], 1
    )
    assert TILTED.jacobian(point) == pytest.approx(numeric, rel=1e-7, abs=1e-6)


def test_image_velocity_is_the_jacobian_times_velocity() -> None:
    point, velocity = np.array([-4.0, 33.0, 1.2]), np.array([0.4, -31.0, 0.0])
    _, speed, _ = TILTED.project_motion(point, velocity, np.zeros(3))
    assert speed == pytest.approx(TILTED.jacobian(point) @ velocity)


def test_image_motion_of_a_braking_vehicle_on_a_level_camera_has_a_closed_form() -> None:
    # u = f X / y(t): u' = -f X y' / y², u'' = f X (2 y'² / y³ - y'' / y²).
    X, y, v, a = 3.0, 40.0, -30.0, 2.5
    _, speed, change = LEVEL.project_motion(
        np.array([X, y, 0.0]), np.array([0.0, v, 0.0]), np.array([0.0, a, 0.0])
    )
    assert speed[0] == pytest.approx(-1100.0 * X * v / y**2)
    assert change[0] == pytest.approx(1100.0 * X * (2 * v**2 / y**3 - a / y**2))
    assert change[1] == pytest.approx(1100.0 * 7.0 * (2 * v**2 / y**3 - a / y**2))
