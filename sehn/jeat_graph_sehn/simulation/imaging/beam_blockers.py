"""Vehicles that stand in the beams of another."""

from __future__ import annotations

import math

from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph_sehn.simulation.imaging.smooth import clamp01

BLOCKERS = 4  # vehicles that may stand before one vehicle's beams
_BLOCKED_M = 0.5  # way through a vehicle after which a beam is blocked


@njit(cache=True, error_model="numpy")
def let_through(
    x: float, y: float, dx: float, dy: float, pose: FloatArray, skin: FloatArray, blockers: IntArray, n: int
) -> float:
    """Part of the light that `n` vehicles let through on the way from (x, y) by (dx, dy) to the ground."""
    left = 1.0
    for k in range(n):
        w = blockers[k]
        outline = (pose[w, 0], pose[w, 1], pose[w, 2], pose[w, 3], 0.48 * skin[w, 0], 0.46 * skin[w, 1])
        left *= 1.0 - clamp01(_way_within(x, y, dx, dy, outline) / _BLOCKED_M)
    return left


@njit(cache=True, error_model="numpy")
def before(
    v: int, x: float, y: float, reach: float, pose: FloatArray, fade: FloatArray, skin: FloatArray,
    blockers: IntArray,
) -> int:  # fmt: skip
    """Find the vehicles that may stand in a vehicle's beams within `reach` m; returns how many."""
    count = 0
    sin, cos = pose[v, 2], pose[v, 3]
    for w in range(len(pose)):
        if w == v or fade[w] <= 0.0:
            continue
        dx, dy = pose[w, 0] - x, pose[w, 1] - y
        forward, right = dx * sin + dy * cos, dx * cos - dy * sin
        half = 0.5 * skin[w, 0]
        if forward > 0.0 and forward - half < reach and abs(right) < 2.0 + 0.3 * forward:
            blockers[count] = w
            count += 1
            if count == BLOCKERS:
                break
    return count


@njit(cache=True, error_model="numpy")
def _way_within(
    x: float, y: float, dx: float, dy: float, outline: tuple[float, float, float, float, float, float]
) -> float:
    """Length (m) of the way from (x, y) by (dx, dy) within a vehicle's outline on the road.

    The outline is x, y, sine and cosine of the direction, half of the length and of the width.
    """
    sin, cos = outline[2], outline[3]
    ox, oy = x - outline[0], y - outline[1]
    low, high = 0.0, 1.0
    for axis in range(2):
        if axis == 0:
            start, step, most = ox * sin + oy * cos, dx * sin + dy * cos, outline[4]
        else:
            start, step, most = ox * cos - oy * sin, dx * cos - dy * sin, outline[5]
        if abs(step) < 1e-9:
            if abs(start) > most:
                return 0.0
            continue
        first, second = (-most - start) / step, (most - start) / step
        low, high = max(low, min(first, second)), min(high, max(first, second))
    return max(0.0, high - low) * math.sqrt(dx * dx + dy * dy)
