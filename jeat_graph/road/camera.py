"""A fixed camera that looks down at a road: which point of the road a pixel shows, and how sure we are of it.

The road is the plane z = 0 of its own axes: x to the right of the view, y along the road away from the
camera, z upwards, all in m. Camera axes are X right, Y down, Z forward. A pinhole with two radial terms of
distortion (Brown's model, as OpenCV writes it). What is not known exactly about the camera is a covariance
over `PARAMETERS`, so that everything computed on the road can carry the calibration's share of its error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from jeat_graph.core import road as core
from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError

# What the covariance is about, in this order: logarithm of the focal length, logarithm of fy / fx, principal
# point (px), radial distortion, a small turn of the camera about its own axes X, Y, Z (rad), its place (m).
PARAMETERS = ("log_f", "log_aspect", "cx", "cy", "k1", "k2", "turn_x", "turn_y", "turn_z", "x", "y", "z")
_UNDISTORT_STEPS = 6


@dataclass(frozen=True)
class Georeference:
    """Where the road's axes lie on the map.

    Attributes:
        east: easting of the road's origin (m).
        north: northing of the road's origin (m).
        bearing_rad: direction of the road's y axis, clockwise from north.
        zone: UTM zone with its hemisphere, such as `33N`, or empty where the metres are of a local grid.
    """

    east: float
    north: float
    bearing_rad: float
    zone: str = ""

    def to_map(self, xy: FloatArray) -> FloatArray:
        """Easting and northing (..., 2) of points of the road (..., 2) in m."""
        c, s = math.cos(self.bearing_rad), math.sin(self.bearing_rad)
        x, y = xy[..., 0], xy[..., 1]
        return np.stack([self.east + c * x + s * y, self.north - s * x + c * y], axis=-1)

    def from_map(self, east_north: FloatArray) -> FloatArray:
        """Points of the road (..., 2) at eastings and northings (..., 2) in m."""
        c, s = math.cos(self.bearing_rad), math.sin(self.bearing_rad)
        e, n = east_north[..., 0] - self.east, east_north[..., 1] - self.north
        return np.stack([c * e - s * n, s * e + c * n], axis=-1)


@dataclass(frozen=True, eq=False)
class RoadCamera:
    """A calibrated camera over a road.

    Attributes:
        width: width of the picture (px).
        height: height of the picture (px).
        fx: focal length in x (px).
        fy: focal length in y (px).
        cx: principal point in x (px).
        cy: principal point in y (px).
        k1: radial distortion with the square of the radius.
        k2: radial distortion with its fourth power.
        rotation: (3, 3) road to camera; its rows are the camera's axes X, Y, Z in the road's.
        position: (3,) place of the camera in the road's axes (m); the last is its height over the road.
        covariance: (12, 12) of `PARAMETERS`.
        georeference: where the road's axes lie on the map, if that is known.

    Raises:
        DataError: a value is not finite, or the camera is not above the road.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    k1: float
    k2: float
    rotation: FloatArray
    position: FloatArray
    covariance: FloatArray = field(default_factory=lambda: np.zeros((len(PARAMETERS), len(PARAMETERS))))
    georeference: Georeference | None = None

    def __post_init__(self) -> None:
        values = [self.fx, self.fy, self.cx, self.cy, self.k1, self.k2]
        if not all(np.isfinite(v).all() for v in (values, self.rotation, self.position, self.covariance)):
            raise DataError("a camera's parameters must be finite numbers")
        if self.fx <= 0 or self.fy <= 0:
            raise DataError(f"a focal length must be positive, got {self.fx:g} and {self.fy:g} px")
        if self.position[2] <= 0:
            raise DataError(f"the camera must be above the road, got a height of {self.position[2]:g} m")

    def compiled(self) -> core.Camera:
        """Return the camera as the core takes it."""
        return core.Camera(
            np.ascontiguousarray(self.rotation, dtype=np.float64),
            np.ascontiguousarray(self.position, dtype=np.float64),
            (self.fx, self.fy),
            (self.cx, self.cy),
            (self.width, self.height),
            (self.k1, self.k2),
        )

    # -- road to picture ------------------------------------------------------------------------------

    def project(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Project points of the road's axes.

        Args:
            points: (..., 3) in m.

        Returns:
            Pixels (..., 2), and depths along the optical axis (...) in m. Pixels of points at or behind the
            camera (depth <= 0) mean nothing.
        """
        local = (points - self.position) @ self.rotation.T
        depth = local[..., 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            n = local[..., :2] / depth[..., None]
            r2 = (n**2).sum(axis=-1, keepdims=True)
            d = n * (1.0 + self.k1 * r2 + self.k2 * r2**2)
        return d * [self.fx, self.fy] + [self.cx, self.cy], depth

    def jacobian(self, points: FloatArray) -> FloatArray:
        """Derivative of the pixel with respect to the point, (..., 2, 3) in px/m, at points (..., 3)."""
        local = (points - self.position) @ self.rotation.T
        Z = local[..., 2]
        n = local[..., :2] / Z[..., None]
        r2 = (n**2).sum(axis=-1)
        # d(n (1 + k1 r² + k2 r⁴)) / dn
        gain, slope = 1.0 + self.k1 * r2 + self.k2 * r2**2, 2.0 * self.k1 + 4.0 * self.k2 * r2
        D = gain[..., None, None] * np.eye(2) + slope[..., None, None] * n[..., :, None] * n[..., None, :]
        D = D * np.array([self.fx, self.fy])[:, None]
        N = np.zeros((*Z.shape, 2, 3))
        N[..., 0, 0] = N[..., 1, 1] = 1.0 / Z
        N[..., :, 2] = -n / Z[..., None]
        return np.asarray(D @ N @ self.rotation, dtype=np.float64)

    # -- picture to road ------------------------------------------------------------------------------

    def rays(self, pixels: FloatArray) -> FloatArray:
        """Directions (..., 3) in the road's axes of what pixels (..., 2) show; not of unit length."""
        n = (pixels - [self.cx, self.cy]) / [self.fx, self.fy]
        if self.k1 or self.k2:
            seen2 = n[..., 0] ** 2 + n[..., 1] ** 2
            inward = np.ones_like(seen2)  # distortion is radial: all that is sought is one factor a pixel
            for _ in range(_UNDISTORT_STEPS):
                r2 = seen2 * inward**2
                inward = 1.0 / (1.0 + r2 * (self.k1 + self.k2 * r2))
            n = n * inward[..., None]
        return np.asarray(n @ self.rotation[:2] + self.rotation[2], dtype=np.float64)

    def to_road(self, pixels: FloatArray, height_m: float | FloatArray = 0.0) -> FloatArray:
        """Places (..., 2) in m that pixels (..., 2) show, if what they show is `height_m` above the road.

        NaN where a pixel shows the sky: at or above the horizon.
        """
        ray = self.rays(pixels)
        down = -ray[..., 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = np.where(down > 0, (self.position[2] - height_m) / down, np.nan)
        return np.asarray(self.position[:2] + ray[..., :2] * reach[..., None], dtype=np.float64)

    def to_road_jacobian(self, xy: FloatArray, height_m: float | FloatArray = 0.0) -> FloatArray:
        """Derivative (..., 2, 2) in m/px of `to_road` with respect to the pixel, at places (..., 2)."""
        z = np.broadcast_to(np.asarray(height_m, dtype=np.float64), xy.shape[:-1])
        J = self.jacobian(np.concatenate([xy, z[..., None]], axis=-1))[..., :2]
        return np.asarray(np.linalg.inv(J), dtype=np.float64)

    # -- what is not known exactly --------------------------------------------------------------------

    def moved(self, change: FloatArray) -> RoadCamera:
        """Return the camera with its `PARAMETERS` changed by (12,)."""
        f = self.fx * math.exp(change[0])
        return replace(
            self,
            fx=f,
            fy=f * (self.fy / self.fx) * math.exp(change[1]),
            cx=self.cx + change[2],
            cy=self.cy + change[3],
            k1=self.k1 + change[4],
            k2=self.k2 + change[5],
            rotation=turn(change[6:9]) @ self.rotation,
            position=self.position + change[9:12],
        )

    def change_to(self, other: RoadCamera) -> FloatArray:
        """Change (12,) of the `PARAMETERS` by which `moved` makes this camera another one."""
        R = other.rotation @ self.rotation.T
        axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
        angle = math.atan2(float(np.linalg.norm(axis)) / 2.0, (float(np.trace(R)) - 1.0) / 2.0)
        scale = 0.5 if angle < 1e-9 else angle / float(np.linalg.norm(axis))
        own, new = self.fy / self.fx, other.fy / other.fx
        lens = [math.log(other.fx / self.fx), math.log(new / own), other.cx - self.cx, other.cy - self.cy]
        return np.array(
            [
                *lens,
                other.k1 - self.k1,
                other.k2 - self.k2,
                *(axis * scale),
                *(other.position - self.position),
            ]
        )

    def calibration_jacobian(self, pixels: FloatArray, height_m: float | FloatArray = 0.0) -> FloatArray:
        """Derivative (..., 2, 12) of `to_road` with respect to `PARAMETERS`; NaN in the sky.

        Of the implicit function: the place moves so that its pixel stays where it is.
        """
        xy = self.to_road(pixels, height_m)
        z = np.broadcast_to(np.asarray(height_m, dtype=np.float64), xy.shape[:-1])
        points = np.concatenate([xy, z[..., None]], axis=-1)
        local = (points - self.position) @ self.rotation.T
        n = local[..., :2] / local[..., 2:]
        r2 = (n**2).sum(axis=-1, keepdims=True)
        straight = n * [self.fx, self.fy]
        by_point = self.jacobian(points)
        by_turn = np.cross(np.eye(3), local[..., None, :])  # rows: about x, y, z

        by_change = np.zeros((*xy.shape, len(PARAMETERS)))
        by_change[..., 0] = straight * (1.0 + self.k1 * r2 + self.k2 * r2**2)
        by_change[..., 1, 1] = by_change[..., 1, 0]
        by_change[..., 0, 2] = by_change[..., 1, 3] = 1.0
        by_change[..., 4] = straight * r2
        by_change[..., 5] = straight * r2**2
        by_change[..., 6:9] = by_point @ self.rotation.T @ np.swapaxes(by_turn, -1, -2)
        by_change[..., 9:] = -by_point
        return np.asarray(-np.linalg.solve(by_point[..., :2], by_change), dtype=np.float64)

    def angles(self) -> tuple[float, float, float]:
        """Pitch (downward), yaw (to the right) and roll (clockwise) of the camera against the road, rad."""
        forward, right = self.rotation[2], self.rotation[0]
        pitch, yaw = math.asin(-float(np.clip(forward[2], -1, 1))), math.atan2(forward[0], forward[1])
        level = mounted(pitch, yaw, 0.0)
        return pitch, yaw, math.atan2(float(right @ level[1]), float(right @ level[0]))


def mounted(pitch: float, yaw: float, roll: float) -> FloatArray:
    """Rotation (3, 3) from the road to a camera tilted down, turned right and rolled clockwise (rad)."""
    ahead = np.array([math.sin(yaw), math.cos(yaw), 0.0])
    right = np.array([math.cos(yaw), -math.sin(yaw), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    forward = math.cos(pitch) * ahead - math.sin(pitch) * up
    down = -math.sin(pitch) * ahead - math.cos(pitch) * up
    c, s = math.cos(roll), math.sin(roll)
    return np.stack([c * right + s * down, c * down - s * right, forward])


def turn(vector: FloatArray) -> FloatArray:
    """Rotation (3, 3) by the length of `vector` (rad) about its direction (Rodrigues' formula)."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if angle < 1e-9:
        return np.asarray(np.eye(3) + cross, dtype=np.float64)
    a, b = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle**2
    return np.asarray(np.eye(3) + a * cross + b * cross @ cross, dtype=np.float64)
