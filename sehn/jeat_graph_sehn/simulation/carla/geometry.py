"""From CARLA's transforms and boxes to our camera, and to the truth of a frame.

CARLA's world is left-handed: x forward, y right, z up, in metres; a camera looks along its own x. Ours looks
along Z with X right and Y down. So the rows of our rotation are CARLA's camera axes y, -z and x in the world.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.carla.visibility import visible_fraction
from jeat_graph_sehn.simulation.segment import FrameTruth
from jeat_graph_sehn.simulation.world.boxes import project_corners
from jeat_graph_sehn.simulation.world.camera import Camera


@dataclass(frozen=True)
class Actor:
    """A spawned vehicle.

    Attributes:
        number: identity within the segment, from 1.
        actor_id: CARLA's own.
        class_name: car, suv, van or truck.
        box: its `carla.BoundingBox`.
    """

    number: int
    actor_id: int
    class_name: str
    box: Any


def field_of_view_deg(width: int, focal_px: float) -> float:
    """Return the horizontal field of view (degrees) of a pinhole camera."""
    return math.degrees(2.0 * math.atan(width / (2.0 * focal_px)))


def camera_at(transform: Any, width: int, height: int, fov_deg: float) -> Camera:
    """Return our camera for a CARLA camera.

    Args:
        transform: its `carla.Transform` in the world.
        width: of the picture (px).
        height: of the picture (px).
        fov_deg: horizontal field of view; CARLA's pixels are square, its principal point is the middle.
    """
    matrix = np.array(transform.get_matrix(), dtype=np.float64)
    forward, right, up = matrix[:3, 0], matrix[:3, 1], matrix[:3, 2]
    focal = width / (2.0 * math.tan(math.radians(fov_deg) / 2.0))
    return Camera(
        width=width,
        height=height,
        fx=focal,
        fy=focal,
        cx=width / 2.0,
        cy=height / 2.0,
        position=matrix[:3, 3],
        rotation=np.stack([right, -up, forward]),
    )


def corners_of(box: Any, transform: Any) -> FloatArray:
    """Return the corners (8, 3) in the world (m) of the `carla.BoundingBox` of an actor at a transform."""
    return np.array([(v.x, v.y, v.z) for v in box.get_world_vertices(transform)], dtype=np.float64)


def frame_truth(
    actors: Sequence[Actor], snapshot: Any, camera: Camera, depth: FloatArray, min_side_px: float
) -> FrameTruth:
    """Return the truth of one tick.

    Args:
        actors: the vehicles, by ascending number; those that are gone are passed over.
        snapshot: `carla.WorldSnapshot` of the tick.
        camera: the camera.
        depth: (H, W) distance along the optical axis at each pixel (m), of the same tick.
        min_side_px: vehicles whose clipped box is thinner or lower are left out.
    """
    seen = [(actor, snapshot.find(actor.actor_id)) for actor in actors]
    seen = [(actor, state) for actor, state in seen if state is not None]
    rows = [_ActorRow.of(actor, state) for actor, state in seen]
    place = np.array([row.corners for row in rows]).reshape(-1, 8, 3)
    centre = np.array([row.centre for row in rows]).reshape(-1, 3)
    velocity = np.array([row.velocity for row in rows]).reshape(-1, 3)
    turn = np.array([row.turn for row in rows]).reshape(-1, 1, 3)
    arm = place - centre[:, None]
    swing = np.cross(turn, arm)
    acceleration = np.array([row.acceleration for row in rows]).reshape(-1, 1, 3)
    boxes = project_corners(place, velocity[:, None] + swing, acceleration + np.cross(turn, swing), camera)
    extent = boxes.clipped[:, 2:] - boxes.clipped[:, :2]
    keep = np.flatnonzero(np.all(extent >= min_side_px, axis=1))
    visible = [visible_fraction(depth, camera, place[k], boxes.hull[k]) for k in keep]
    return FrameTruth(
        object_id=np.array([seen[k][0].number for k in keep], dtype=np.int64),
        class_name=np.array([seen[k][0].class_name for k in keep], dtype="U5"),
        boxes=np.concatenate([boxes.clipped[keep, :2], extent[keep]], axis=1),
        visible=np.array(visible, dtype=np.float64),
        motion=boxes.motion[keep],
        size=np.array([rows[k].size for k in keep]).reshape(-1, 3),
        pose=np.concatenate([centre[keep], np.array([rows[k].angles for k in keep]).reshape(-1, 3)], axis=1),
        velocity=velocity[keep],
    )


@dataclass(frozen=True)
class _ActorRow:
    """State of one vehicle in plain numbers: m, m/s, m/s², rad, rad/s, in CARLA's world axes."""

    corners: FloatArray
    centre: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    turn: FloatArray
    angles: tuple[float, float, float]
    size: tuple[float, float, float]

    @staticmethod
    def of(actor: Actor, state: Any) -> _ActorRow:
        transform = state.get_transform()
        corners = corners_of(actor.box, transform)
        rotation, extent = transform.rotation, actor.box.extent
        # Only the turn about the vertical: roll and pitch of a vehicle on a road shake, they do not turn.
        yaw_rate = math.radians(state.get_angular_velocity().z)
        return _ActorRow(
            corners=corners,
            centre=corners.mean(axis=0),
            velocity=_vector(state.get_velocity()),
            acceleration=_vector(state.get_acceleration()),
            turn=np.array([0.0, 0.0, yaw_rate]),
            angles=(
                math.radians(rotation.roll),
                math.radians(rotation.pitch),
                math.radians(rotation.yaw),
            ),
            size=(2.0 * extent.x, 2.0 * extent.y, 2.0 * extent.z),
        )


def _vector(value: Any) -> FloatArray:
    return np.array([value.x, value.y, value.z], dtype=np.float64)
