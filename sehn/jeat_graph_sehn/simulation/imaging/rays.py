"""Rays in a world with a bent road: where they meet walls along it, and boxes."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray

LEAST_M = 0.5  # nothing is seen that is nearer to the camera


@njit(cache=True, error_model="numpy")
def road_place(x: float, y: float, curvature: float) -> tuple[float, float]:
    """Place across and along the road of a place in the world (m)."""
    if curvature == 0.0:
        return x, y
    radius = 1.0 / curvature
    side = 1.0 if curvature > 0.0 else -1.0
    dx, dy = (radius - x) * side, y
    return radius - side * math.hypot(dx, dy), math.atan2(dy, dx) / abs(curvature)


@njit(cache=True, error_model="numpy")
def wall_hits(eye: FloatArray, dx: float, dy: float, across: float, curvature: float) -> tuple[float, float]:
    """Where a ray meets the upright wall at a place across the road: twice, infinite for nowhere."""
    if curvature == 0.0:
        if dx == 0.0:
            return np.inf, np.inf
        t = (across - eye[0]) / dx
        return (t if t > LEAST_M else np.inf), np.inf
    cx = eye[0] - 1.0 / curvature
    radius = 1.0 / curvature - across
    a = dx * dx + dy * dy
    b = cx * dx + eye[1] * dy
    c = cx * cx + eye[1] * eye[1] - radius * radius
    root = b * b - a * c
    if root < 0.0 or a == 0.0:
        return np.inf, np.inf
    root = math.sqrt(root)
    first, second = (-b - root) / a, (-b + root) / a
    return (first if first > LEAST_M else np.inf), (second if second > LEAST_M else np.inf)


@njit(cache=True, error_model="numpy")
def box_hit(
    eye: FloatArray, dx: float, dy: float, dz: float, box: FloatArray
) -> tuple[float, float, float, float]:
    """Where a ray enters a box, and the face's normal there; infinite for nowhere."""
    sin, cos = box[2], box[3]
    ox, oy = eye[0] - box[0], eye[1] - box[1]
    start = (ox * sin + oy * cos, ox * cos - oy * sin, eye[2])
    step = (dx * sin + dy * cos, dx * cos - dy * sin, dz)
    low, high, axis = -np.inf, np.inf, 0
    for k in range(3):
        least, most = box[4 + 2 * k], box[5 + 2 * k]
        if abs(step[k]) < 1e-12:
            if start[k] < least or start[k] > most:
                return np.inf, 0.0, 0.0, 0.0
            continue
        a, b = (least - start[k]) / step[k], (most - start[k]) / step[k]
        if min(a, b) > low:
            low, axis = min(a, b), k
        high = min(high, max(a, b))
    if high <= low or low < LEAST_M:
        return np.inf, 0.0, 0.0, 0.0
    way = -1.0 if step[axis] > 0.0 else 1.0
    if axis == 0:
        return low, way * sin, way * cos, 0.0
    if axis == 1:
        return low, way * cos, -way * sin, 0.0
    return low, 0.0, 0.0, way
