"""Which box a vehicle makes in the picture: the hull of a cuboid of its length, width and height on the road.

The middle of a box's lower edge is not where the vehicle stands: from a gantry it is the near bumper, beside
the road it is a corner, and a lorry's is metres away from its middle. So the box is modelled by its four
sides, each the outermost of the eight corners.
"""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.road.camera import RoadCamera

_A = np.array([-0.5, -0.5, 0.5, 0.5] * 2)
_B = np.array([-0.5, 0.5, -0.5, 0.5] * 2)
_TOP = np.repeat([0.0, 1.0], 4)


def corners(xy: FloatArray, heading: FloatArray, size: FloatArray) -> FloatArray:
    """Corners (N, 8, 3) in m of cuboids on the road.

    Args:
        xy: (N, 2) middle of the footprint (m).
        heading: (N,) direction of the long axis, from y towards x (rad).
        size: (3,) or (N, 3) length, width, height (m).
    """
    sin, cos = np.sin(heading)[:, None], np.cos(heading)[:, None]
    size = np.broadcast_to(size, (len(xy), 3))
    along, across = size[:, :1] * _A, size[:, 1:2] * _B
    return np.stack(
        [
            xy[:, :1] + along * sin + across * cos,
            xy[:, 1:] + along * cos - across * sin,
            size[:, 2:] * _TOP,
        ],
        axis=-1,
    )


def sides(
    camera: RoadCamera, xy: FloatArray, heading: FloatArray, size: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Sides of the boxes that cuboids make in the picture.

    Args:
        camera: the camera.
        xy: (N, 2) middle of the footprint (m).
        heading: (N,) direction of the long axis, from y towards x (rad).
        size: (3,) or (N, 3) length, width, height (m).

    Returns:
        Left, top, right, bottom (N, 4) in px, and their derivatives (N, 4, 5) with respect to x, y,
        length, width and height. NaN where a corner is not in front of the camera.
    """
    place = corners(xy, heading, size)
    pixel, depth = camera.project(place)
    front = np.asarray((depth > 0).all(axis=1))
    pixel = np.where(front[:, None, None], pixel, np.nan)
    finite = np.nan_to_num(pixel)
    outer = np.concatenate([finite.argmin(axis=1), finite.argmax(axis=1)], axis=1)  # (N, 4)
    rows = np.arange(len(xy))[:, None]
    axis = np.array([0, 1, 0, 1])
    slope = camera.jacobian(place[rows, outer])[rows, np.arange(4), axis]  # (N, 4, 3)
    sin, cos = np.sin(heading)[:, None], np.cos(heading)[:, None]
    a, b = _A[outer], _B[outer]
    J = np.stack(
        [
            slope[..., 0],
            slope[..., 1],
            a * (slope[..., 0] * sin + slope[..., 1] * cos),
            b * (slope[..., 0] * cos - slope[..., 1] * sin),
            _TOP[outer] * slope[..., 2],
        ],
        axis=-1,
    )
    return pixel[rows, outer, axis], J
