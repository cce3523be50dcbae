"""Where the vehicles' tracks meet in the picture: the vanishing point of the road's direction."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray

_DRAWS = 600
_INLIER_PX = 6.0
_LEAST_SINE = 0.01
_REFINEMENTS = 20
_SOFT_PX = 3.0


def vanishing_point(pixels: FloatArray) -> FloatArray | None:
    """Find the point that most tracks, drawn on as straight lines, come closest to.

    Pairs of tracks propose points (RANSAC with a fixed seed, cost cut off at a few px), then all tracks
    refine the best one by least squares with Cauchy weights. The error of a track is how far its end lies
    beside the line from its middle to the point.

    Args:
        pixels: (K, M, 2) points of K tracks.

    Returns:
        The point (2,) in px, or None where fewer than two tracks point to one.
    """
    if len(pixels) < 2:
        return None
    centre = np.median(pixels, axis=1)
    about = pixels - pixels.mean(axis=1, keepdims=True)
    direction = np.linalg.svd(about, full_matrices=False)[2][:, 0]
    normal = np.stack([-direction[:, 1], direction[:, 0]], axis=1)
    offset = (normal * centre).sum(axis=1)
    reach = np.linalg.norm(pixels[:, -1] - pixels[:, 0], axis=1) / 2.0

    def beside(point: FloatArray) -> FloatArray:
        far = np.linalg.norm(point - centre, axis=1) + 1e-9
        return np.asarray((normal @ point - offset) / far * reach, dtype=np.float64)

    rng = np.random.default_rng(0)
    best: tuple[float, FloatArray] | None = None
    for _ in range(_DRAWS):
        pair = rng.choice(len(normal), 2, replace=False)
        if abs(np.linalg.det(normal[pair])) < _LEAST_SINE:
            continue
        point = np.linalg.solve(normal[pair], offset[pair])
        cost = float(np.minimum(np.abs(beside(point)) / _INLIER_PX, 1.0).sum())
        if best is None or cost < best[0]:
            best = cost, point
    if best is None:
        return None
    point = best[1]
    for _ in range(_REFINEMENTS):
        far = np.linalg.norm(point - centre, axis=1) + 1e-9
        weight = reach / far / (1.0 + (beside(point) / _SOFT_PX) ** 2)
        point = np.linalg.lstsq(normal * weight[:, None], offset * weight, rcond=None)[0]
    return np.asarray(point, dtype=np.float64)
