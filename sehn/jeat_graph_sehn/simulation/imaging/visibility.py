"""Depth and instance buffers, and how much of each vehicle can be seen."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph_sehn.simulation.imaging.moments import (
    BOX,
    FACE,
    FACE_PLANE,
    FACE_RECORD,
    FACES,
    HULL,
    SIDES,
    Look,
    Moments,
)
from jeat_graph_sehn.simulation.imaging.shapes import PARTS


def buffers(
    moments: Moments, look: Look, front_depth: FloatArray, front_cover: FloatArray
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Render depth and identity at the pixels' centres, at the first of the moments.

    The part of a vehicle that can be seen is the number of its pixels in the picture that nothing nearer
    covers, barriers included, over the number of pixels of its outline if it were alone and the picture
    three times as wide and high.

    Args:
        moments: the vehicles.
        look: what they look like.
        front_depth: (H, W) depth of barriers and poles (m).
        front_cover: (H, W) their cover of the pixel; they count where it is half or more.

    Returns:
        Depth (H, W) of the nearest vehicle or barrier (m, infinite for none), identity (H, W) of the vehicle
        (0: none), and the visible part (V,) of each vehicle.
    """
    height, width = front_depth.shape
    depth = np.where(front_cover >= 0.5, front_depth, np.inf)
    instance = np.zeros((height, width), dtype=np.int64)
    whole, seen = np.zeros((2, len(look.number)), dtype=np.int64)
    owner = np.full((height, width), -1, dtype=np.int32)
    _fill(depth, instance, owner, whole, seen, np.ascontiguousarray(moments.body[0]), look.number)
    return depth, instance, seen / np.maximum(whole, 1)


@njit(cache=True, error_model="numpy")
def _fill(
    depth: FloatArray, instance: IntArray, owner: npt.NDArray[np.int32], whole: IntArray, seen: IntArray,
    bodies: FloatArray, number: IntArray,
) -> None:  # fmt: skip
    """Fill all buffers, vehicle by vehicle, whose pixels are counted in passing.

    `owner` (H, W) is the row of the vehicle in each pixel, -1 at first, and `bodies` (V, PARTS, BODY_RECORD)
    are taken number by number: parts of arrays would count references, several times a pixel.
    """
    height, width = depth.shape
    for v in range(len(number)):
        left, top, right, low = 1e9, 1e9, -1e9, -1e9
        for part in range(PARTS):
            if bodies[v, part, SIDES] > 0.0:
                left, top = min(left, bodies[v, part, BOX]), min(top, bodies[v, part, BOX + 1])
                right, low = max(right, bodies[v, part, BOX + 2]), max(low, bodies[v, part, BOX + 3])
        for row in range(int(max(top, -height)), int(min(low, 2 * height))):
            for column in range(int(max(left, -width)), int(min(right, 2 * width))):
                near = np.inf
                for part in range(PARTS):
                    near = min(near, _depth_at(column + 0.5, row + 0.5, bodies, v, part))
                if near == np.inf:
                    continue
                whole[v] += 1
                if 0 <= row < height and 0 <= column < width and near < depth[row, column]:
                    depth[row, column] = near
                    instance[row, column] = number[v]
                    if owner[row, column] >= 0:
                        seen[owner[row, column]] -= 1
                    owner[row, column] = v
                    seen[v] += 1


@njit(cache=True, error_model="numpy", inline="always")
def _depth_at(u: float, w: float, bodies: FloatArray, v: int, part: int) -> float:
    """Depth of a body along the ray through a place in the picture; infinite where it misses."""
    out = np.inf
    within = bodies[v, part, SIDES] > 0.0
    for k in range(int(bodies[v, part, SIDES])):
        at = HULL + 3 * k
        if bodies[v, part, at] * u + bodies[v, part, at + 1] * w + bodies[v, part, at + 2] < 0.5:
            within = False
            break
    if within:
        # Within its outline, the face that is hit is that of the least inverse depth: a convex body's nearest
        # visible plane is the last one that the ray enters.
        inverse = np.inf
        for f in range(int(bodies[v, part, FACES])):
            at = FACE + f * FACE_RECORD + FACE_PLANE
            plane = bodies[v, part, at] * u + bodies[v, part, at + 1] * w + bodies[v, part, at + 2]
            inverse = min(inverse, plane)
        if 0.0 < inverse < np.inf:
            out = 1.0 / inverse
    return out
