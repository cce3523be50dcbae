"""Depth and instance buffers, and how much of each vehicle can be seen."""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.simulation.imaging.moments import (
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
from jeat_graph.simulation.imaging.shapes import PARTS


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
    whole = np.zeros(len(look.number), dtype=np.int64)
    _fill(depth, instance, whole, moments, look)
    seen = np.bincount(instance.ravel(), minlength=len(look.number) + 1)[1:]
    number = np.concatenate([np.zeros(1, dtype=np.int64), look.number])
    return depth, number[instance], seen / np.maximum(whole, 1)


@njit(cache=True, error_model="numpy")
def _fill(depth: FloatArray, instance: IntArray, whole: IntArray, moments: Moments, look: Look) -> None:
    height, width = depth.shape
    for v in range(len(look.number)):
        left, top, right, low = 1e9, 1e9, -1e9, -1e9
        for part in range(PARTS):
            body = moments.body[0, v, part]
            if body[SIDES] > 0.0:
                left, top = min(left, body[BOX]), min(top, body[BOX + 1])
                right, low = max(right, body[BOX + 2]), max(low, body[BOX + 3])
        for row in range(int(max(top, -height)), int(min(low, 2 * height))):
            for column in range(int(max(left, -width)), int(min(right, 2 * width))):
                near = np.inf
                for part in range(PARTS):
                    near = min(near, _depth_at(column + 0.5, row + 0.5, moments.body[0, v, part]))
                if near == np.inf:
                    continue
                whole[v] += 1
                if 0 <= row < height and 0 <= column < width and near < depth[row, column]:
                    depth[row, column] = near
                    instance[row, column] = v + 1


@njit(cache=True, error_model="numpy")
def _depth_at(u: float, w: float, body: FloatArray) -> float:
    """Depth of a body (its record) along the ray through a place in the picture; infinite where it misses."""
    sides = int(body[SIDES])
    if sides == 0:
        return np.inf
    for k in range(sides):
        at = HULL + 3 * k
        if body[at] * u + body[at + 1] * w + body[at + 2] < 0.5:
            return np.inf
    # Within its outline, the face that is hit is that of the least inverse depth: a convex body's nearest
    # visible plane is the last one that the ray enters.
    inverse = np.inf
    for f in range(int(body[FACES])):
        at = FACE + f * FACE_RECORD + FACE_PLANE
        inverse = min(inverse, body[at] * u + body[at + 1] * w + body[at + 2])
    return 1.0 / inverse if 0.0 < inverse < np.inf else np.inf
