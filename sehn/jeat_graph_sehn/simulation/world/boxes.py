"""Projects 3D boxes of vehicles into the picture: 2D boxes, with the motion of their centres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph_sehn.simulation.world.camera import Camera
from jeat_graph_sehn.simulation.world.scene import VehicleStates

NEAR_PLANE_M = 1.0
# The twelve edges of a box whose corners are numbered as in `VehicleStates.corners`.
_EDGES = np.array(
    [(0, 1), (2, 3), (0, 2), (1, 3), (4, 5), (6, 7), (4, 6), (5, 7), (0, 4), (1, 5), (2, 6), (3, 7)]
)


@dataclass(frozen=True, eq=False)
class ProjectedBoxes:
    """Hulls of the projected corners.

    Attributes:
        hull: (N, 4) left, top, right, bottom (px), not clipped to the picture.
        clipped: (N, 4) the same clipped to the picture; empty or inverted where it lies outside.
        motion: (N, 6) x, y, vx, vy, ax, ay of the hull's centre (px, px/s, px/s²).
        in_picture: (N,) fraction of the hull's area within the picture.
        whole: (N,) false where a part of the vehicle is behind the near plane; such a hull is of the part in
            front, and its motion means little.
    """

    hull: FloatArray
    clipped: FloatArray
    motion: FloatArray
    in_picture: FloatArray
    whole: BoolArray


def project_boxes(states: VehicleStates, camera: Camera) -> ProjectedBoxes:
    """Project vehicles into the picture (see `project_corners`)."""
    place, velocity, acceleration = states.corners()
    assert velocity is not None
    assert acceleration is not None
    return project_corners(place, velocity, acceleration, camera)


def project_corners(
    place: FloatArray, velocity: FloatArray, acceleration: FloatArray, camera: Camera
) -> ProjectedBoxes:
    """Project the corners of 3D boxes into the picture.

    The hull's left edge moves as the corner that is leftmost now, and so on, so that velocity and
    acceleration are exact in closed form on either side of the moments when the outermost corner changes.

    Args:
        place: (N, 8, 3) corners in the world (m); numbers of corners that share an edge differ in one bit.
        velocity: (N, 8, 3) m/s.
        acceleration: (N, 8, 3) m/s².
        camera: the camera.

    Returns:
        Boxes of all N rows; those wholly behind the camera have an empty hull (all zero).
    """
    depth = camera.to_camera(place)[..., 2]
    front = depth > NEAR_PLANE_M
    whole: BoolArray = np.all(front, axis=1)
    # Corners behind the near plane are put on it; they are replaced below and never become outermost.
    with np.errstate(divide="ignore", invalid="ignore"):
        pixel, speed, change = camera.project_motion(place, velocity, acceleration)
    low = np.where(front[..., None], pixel, np.inf)
    high = np.where(front[..., None], pixel, -np.inf)
    first, last = np.argmin(low, axis=1), np.argmax(high, axis=1)  # (N, 2) corner outermost in u, v

    def centre(values: FloatArray) -> FloatArray:
        pick = [np.take_along_axis(values, index[:, None, :], axis=1)[:, 0] for index in (first, last)]
        out: FloatArray = (pick[0] + pick[1]) / 2.0
        return out

    hull = np.concatenate([low.min(axis=1), high.max(axis=1)], axis=1)
    for row in np.flatnonzero(front.any(axis=1) & ~whole):
        hull[row] = _near_clipped_hull(place[row], depth[row], camera)
    hull[~front.any(axis=1)] = 0.0
    motion = np.concatenate([centre(pixel), centre(speed), centre(change)], axis=1)
    motion[~front.any(axis=1)] = 0.0
    edge = np.array([camera.width, camera.height, camera.width, camera.height], dtype=np.float64)
    clipped = np.clip(hull, 0.0, edge)
    area = np.prod(hull[:, 2:] - hull[:, :2], axis=1)
    inside = np.prod(clipped[:, 2:] - clipped[:, :2], axis=1)
    return ProjectedBoxes(
        hull=hull,
        clipped=clipped,
        motion=motion,
        in_picture=np.divide(inside, area, out=np.zeros_like(area), where=area > 0.0),
        whole=whole,
    )


def _near_clipped_hull(place: FloatArray, depth: FloatArray, camera: Camera) -> FloatArray:
    """Hull (4,) of the part of a box (8, 3) that lies in front of the near plane."""
    start, end = place[_EDGES[:, 0]], place[_EDGES[:, 1]]
    a, b = depth[_EDGES[:, 0]], depth[_EDGES[:, 1]]
    crosses = (a > NEAR_PLANE_M) != (b > NEAR_PLANE_M)
    share = ((NEAR_PLANE_M - a[crosses]) / (b[crosses] - a[crosses]))[:, None]
    points = np.concatenate(
        [place[depth > NEAR_PLANE_M], start[crosses] + share * (end[crosses] - start[crosses])]
    )
    pixel, _ = camera.project(points)
    return np.concatenate([pixel.min(axis=0), pixel.max(axis=0)])
