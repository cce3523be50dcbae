"""Measures how much of a vehicle can be seen, from a depth picture of CARLA (experimental)."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.world.camera import Camera

_SAMPLES = 48  # at most so many rays across and down a vehicle's hull
_MARGIN_M = 0.3  # something nearer by more than this covers: mirrors and wheel arches stand out of the box


def visible_fraction(depth: FloatArray, camera: Camera, corners: FloatArray, hull: FloatArray) -> float:
    """Return the fraction of a box's projected area within the picture that nothing nearer covers.

    Rays through a grid on the hull are cut with the box; where the depth picture ends before the box begins,
    something covers it. Behind windows the picture ends within or beyond the box, which is not covered.

    Args:
        depth: (H, W) distance along the optical axis (m).
        camera: the camera.
        corners: (8, 3) corners of the box in the world (m); numbers that share an edge differ in one bit.
        hull: (4,) left, top, right, bottom of the projected box (px), not clipped.
    """
    u = _grid(hull[0], hull[2])
    v = _grid(hull[1], hull[3])
    ray_u, ray_v = (grid.reshape(-1) for grid in np.meshgrid(u, v))
    local = np.stack(
        [(ray_u - camera.cx) / camera.fx, (ray_v - camera.cy) / camera.fy, np.ones_like(ray_u)], axis=1
    )
    enter, leave = _cut(local @ camera.rotation, camera.position, corners)
    hit = (enter <= leave) & (leave > 0.0)
    if not hit.any():
        return 0.0
    column, row = np.floor(ray_u).astype(np.int64), np.floor(ray_v).astype(np.int64)
    inside = hit & (column >= 0) & (row >= 0) & (column < camera.width) & (row < camera.height)
    clear = depth[row[inside], column[inside]] >= enter[inside] - _MARGIN_M
    return float(clear.sum() / hit.sum())


def _grid(low: float, high: float) -> FloatArray:
    """Middles of equal parts of an interval, one a pixel at most."""
    count = int(np.clip(np.ceil(high - low), 2, _SAMPLES))
    return np.asarray(low + (high - low) * (np.arange(count) + 0.5) / count, dtype=np.float64)


def _cut(ray: FloatArray, origin: FloatArray, corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distances (R,), in lengths of `ray` (R, 3), at which rays from `origin` enter and leave a box."""
    centre = corners.mean(axis=0)
    edges = corners[[1, 2, 4]] - corners[0]
    length = np.linalg.norm(edges, axis=1)
    axes = edges / length[:, None]
    start, way = axes @ (origin - centre), ray @ axes.T
    with np.errstate(divide="ignore", invalid="ignore"):
        first = (-0.5 * length - start) / way
        second = (0.5 * length - start) / way
    near, far = np.fmin(first, second), np.fmax(first, second)
    return np.asarray(near.max(axis=1)), np.asarray(far.min(axis=1))
