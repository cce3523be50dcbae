"""Projects the road's markings into the picture, as a backdrop for drawings."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.world.scene import Scene

_NEAR_M, _FAR_M = 3.0, 400.0
_DASH_M, _GAP_M = 6.0, 12.0


def marking_lines(scene: Scene) -> list[FloatArray]:
    """Project the edges of the carriageways, whole, and the lines between lanes, dashed.

    Returns:
        Polylines (K, 2) in px; parts of them may lie outside the picture.
    """
    config = scene.road.config
    inner, width, n = config.median_m / 2.0, config.lane_width_m, config.lanes_per_direction
    edges = inner + width * np.array([0.0, n])
    shoulder = edges[1] + config.shoulder_m
    between = inner + width * np.arange(1, n)
    lines = [_segment(x, _NEAR_M, _FAR_M) for x in (*edges, *-edges, shoulder, -shoulder)]
    starts = np.arange(_NEAR_M, _FAR_M, _DASH_M + _GAP_M)
    lines += [_segment(x, y, y + _DASH_M) for x in (*between, *-between) for y in starts]
    return [scene.camera.project(line)[0] for line in lines]


def _segment(x: float, start_m: float, end_m: float) -> FloatArray:
    # Geometric steps: a straight line stays straight in the picture, but its near end passes the camera.
    y = np.geomspace(start_m, end_m, 24)
    return np.stack([np.full_like(y, x), y, np.zeros_like(y)], axis=1)
