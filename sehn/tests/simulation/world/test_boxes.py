"""Boxes of vehicles in the picture, and the motion of their centres."""

from itertools import product

import numpy as np
import pytest

from jeat_graph_sehn.simulation.world.boxes import project_boxes
from jeat_graph_sehn.simulation.world.camera import Camera, CameraConfig
from jeat_graph_sehn.simulation.world.scene import VehicleStates

LEVEL = Camera.mounted(CameraConfig(pitch_deg=0.0, offset_m=0.0, mount_height_m=7.0))


def one(pose: list[float], size: list[float], velocity: list[float] | None = None) -> VehicleStates:
    return VehicleStates(
        frame=np.array([0]),
        object_id=np.array([1]),
        kind=np.array([0]),
        size=np.array([size]),
        pose=np.array([pose]),
        velocity=np.array([velocity or [0.0, 0.0, 0.0]]),
        acceleration=np.zeros((1, 3)),
        direction=np.array([1]),
        parked=np.array([False]),
    )


def test_a_vehicle_straight_ahead_has_the_box_of_its_near_face_and_far_roof() -> None:
    box = project_boxes(one([0.0, 42.0, 0.0], [4.0, 2.0, 1.5]), LEVEL).hull[0]
    near, far = 40.0, 44.0
    assert box == pytest.approx(
        [640 - 1100 / near, 360 + 1100 * 5.5 / far, 640 + 1100 / near, 360 + 1100 * 7 / near]
    )


def test_corners_are_those_of_a_box_turned_by_its_heading() -> None:
    heading, size = 0.3, np.array([4.6, 1.8, 1.5])
    corners, _, _ = one([2.0, 30.0, heading], list(size)).corners()
    long = np.array([np.sin(heading), np.cos(heading), 0.0])
    wide = np.array([np.cos(heading), -np.sin(heading), 0.0])
    expected = {
        tuple(
            np.round(
                [2.0, 30.0, 0.0] + a * size[0] / 2 * long + b * size[1] / 2 * wide + [0, 0, z * size[2]], 9
            )
        )
        for a, b, z in product((-1, 1), (-1, 1), (0, 1))
    }
    assert {tuple(np.round(c, 9)) for c in corners[0]} == expected


def test_a_vehicle_behind_the_camera_has_no_box() -> None:
    found = project_boxes(one([0.0, -20.0, 0.0], [4.0, 2.0, 1.5]), LEVEL)
    assert not found.hull.any()
    assert found.in_picture == pytest.approx(0.0)


def test_a_truck_half_under_the_gantry_keeps_the_box_of_its_front_part() -> None:
    # From depth 1 m (the near plane) to the far end at 9 m; top 3 m and road 7 m below the camera.
    found = project_boxes(one([0.0, 1.0, 0.0], [16.0, 2.5, 4.0]), LEVEL)
    assert not found.whole[0]
    assert found.hull[0] == pytest.approx([640 - 1375, 360 + 1100 * 3 / 9, 640 + 1375, 360 + 1100 * 7])


def test_the_centre_moves_as_the_outermost_corners_do() -> None:
    moving = one([3.0, 42.0, 0.0], [4.0, 2.0, 1.5], [0.0, 30.0, 0.0])
    x, y, vx, vy, _, _ = project_boxes(moving, LEVEL).motion[0]
    # Leftmost: x = 2 at the far end; rightmost: x = 4 at the near end. Top: far roof; bottom: near road.
    assert x == pytest.approx(640 + 1100 * (2 / 44 + 4 / 40) / 2)
    assert y == pytest.approx(360 + 1100 * (5.5 / 44 + 7 / 40) / 2)
    assert vx == pytest.approx(-1100 * 30 * (2 / 44**2 + 4 / 40**2) / 2)
    assert vy == pytest.approx(-1100 * 30 * (5.5 / 44**2 + 7 / 40**2) / 2)
