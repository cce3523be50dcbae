"""A calibrated pinhole camera on a gantry.

World axes: x to the right of the view along the road, y along the road away from the gantry, z up, in m;
the origin is on the road below the gantry. Camera axes: X right, Y down, Z forward. No lens distortion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from jeat_graph.config.fields import check, number
from jeat_graph.data.arrays import FloatArray


@dataclass(frozen=True)
class CameraConfig:
    """Calibration and mounting of the camera."""

    width: int = number(1280, "px", "width of the picture", 16)
    height: int = number(720, "px", "height of the picture", 16)
    fx: float = number(1100.0, "px", "focal length in x", open_low=True)
    fy: float = number(1100.0, "px", "focal length in y", open_low=True)
    cx: float = number(640.0, "px", "principal point in x")
    cy: float = number(360.0, "px", "principal point in y")
    mount_height_m: float = number(7.5, "m", "height of the camera above the road", open_low=True)
    offset_m: float = number(1.0, "m", "place across the road, right of the median", low=-50.0, high=50.0)
    pitch_deg: float = number(14.0, "deg", "downward tilt", 0.0, 89.0)
    yaw_deg: float = number(0.0, "deg", "turn to the right", -60.0, 60.0)
    roll_deg: float = number(0.0, "deg", "turn about the line of sight, clockwise as seen", -30.0, 30.0)

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera with its pose.

    Attributes:
        width: width of the picture (px).
        height: height of the picture (px).
        fx: focal length in x (px).
        fy: focal length in y (px).
        cx: principal point in x (px).
        cy: principal point in y (px).
        position: (3,) place in the world (m).
        rotation: (3, 3) world to camera; its rows are the camera's axes X, Y, Z in the world.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    position: FloatArray
    rotation: FloatArray

    @staticmethod
    def mounted(config: CameraConfig) -> Camera:
        """Mount a camera on the gantry as configured."""
        rotation = turned(config.pitch_deg, config.yaw_deg, config.roll_deg)
        return Camera(
            width=config.width,
            height=config.height,
            fx=config.fx,
            fy=config.fy,
            cx=config.cx,
            cy=config.cy,
            position=np.array([config.offset_m, 0.0, config.mount_height_m]),
            rotation=rotation,
        )

    def to_camera(self, points: FloatArray) -> FloatArray:
        """Transform points (..., 3) from the world to camera axes (m)."""
        return (points - self.position) @ self.rotation.T

    def project(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Project points of the world.

        Args:
            points: (..., 3) in the world (m).

        Returns:
            Pixels (..., 2) and depths along the optical axis (...) in m. Pixels of points at or behind
            the camera (depth <= 0) mean nothing.
        """
        local = self.to_camera(points)
        depth = local[..., 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            u = self.fx * local[..., 0] / depth + self.cx
            v = self.fy * local[..., 1] / depth + self.cy
        return np.stack([u, v], axis=-1), depth

    def jacobian(self, points: FloatArray) -> FloatArray:
        """Derivative of the pixel with respect to the point in the world, (..., 2, 3) in px/m."""
        local = self.to_camera(points)
        X, Y, Z = local[..., 0], local[..., 1], local[..., 2]
        J = np.zeros((*local.shape[:-1], 2, 3))
        J[..., 0, 0] = self.fx / Z
        J[..., 0, 2] = -self.fx * X / Z**2
        J[..., 1, 1] = self.fy / Z
        J[..., 1, 2] = -self.fy * Y / Z**2
        return J @ self.rotation

    def project_motion(
        self, points: FloatArray, velocity: FloatArray, acceleration: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Project moving points: pixel, image velocity and image acceleration, in closed form.

        With the normalised coordinate n = X / Z, differentiating n Z = X twice gives
        n' = (X' - n Z') / Z and n'' = (X'' - n Z'' - 2 n' Z') / Z.

        Args:
            points: (..., 3) place in the world (m), in front of the camera.
            velocity: (..., 3) m/s.
            acceleration: (..., 3) m/s².

        Returns:
            Pixels (..., 2), px/s (..., 2) and px/s² (..., 2).
        """
        P, V, A = self.to_camera(points), velocity @ self.rotation.T, acceleration @ self.rotation.T
        Z, Zd, Zdd = P[..., 2:], V[..., 2:], A[..., 2:]
        n = P[..., :2] / Z
        nd = (V[..., :2] - n * Zd) / Z
        ndd = (A[..., :2] - n * Zdd - 2.0 * nd * Zd) / Z
        focal, centre = np.array([self.fx, self.fy]), np.array([self.cx, self.cy])
        return focal * n + centre, focal * nd, focal * ndd

    def to_dict(self) -> dict[str, Any]:
        """Return the calibration as plain values, for a YAML file."""
        return {
            "width": self.width,
            "height": self.height,
            "fx": self.fx,
            "fy": self.fy,
            "cx": self.cx,
            "cy": self.cy,
            "position_m": [float(v) for v in self.position],
            "rotation_world_to_camera": [[float(v) for v in row] for row in self.rotation],
            "axes": "world x right, y along the road, z up; camera X right, Y down, Z forward",
        }


def turned(pitch_deg: float, yaw_deg: float, roll_deg: float) -> FloatArray:
    """Rotation (3, 3) from the world to a camera tilted down, turned right and rolled clockwise (deg)."""
    pitch, yaw = math.radians(pitch_deg), math.radians(yaw_deg)
    ahead = np.array([math.sin(yaw), math.cos(yaw), 0.0])
    right = np.array([math.cos(yaw), -math.sin(yaw), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    forward = math.cos(pitch) * ahead - math.sin(pitch) * up
    down = -math.sin(pitch) * ahead - math.cos(pitch) * up
    if roll_deg:
        cos, sin = math.cos(math.radians(roll_deg)), math.sin(math.radians(roll_deg))
        right, down = cos * right + sin * down, cos * down - sin * right
    return np.stack([right, down, forward])
