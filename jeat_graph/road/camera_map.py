"""The way from one calibrated camera's picture into another's, for what stands on the road below both."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.errors import DataError
from jeat_graph.data.picture_map import PictureMap
from jeat_graph.rig.homography import fit_with_parallax
from jeat_graph.road.camera import RoadCamera

# Boxes by which the map is fitted: lower edges in so many columns and rows, of things so tall (m), as far as
# there is road (m).
_COLUMNS, _ROWS, _HEIGHTS_M, _FARTHEST_M = 9, 12, (1.4, 2.2, 3.8), 150.0
_LEAST_BOXES = 30


def map_between(own: RoadCamera, common: RoadCamera) -> tuple[PictureMap, float]:
    """Return the map with parallax that is nearest to two cameras, and what it leaves (rms, px).

    Args:
        own: the camera whose boxes are mapped.
        common: the camera of the common picture; both with the same axes of the road.

    Raises:
        DataError: they do not see the same road.
    """
    columns = (np.arange(_COLUMNS) + 0.5) / _COLUMNS * own.width
    rows = (np.arange(_ROWS) + 0.5) / _ROWS * own.height
    lower = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    ground = own.to_road(lower)
    seen = np.isfinite(ground).all(axis=1)
    seen &= np.hypot(ground[:, 0] - own.position[0], ground[:, 1] - own.position[1]) < _FARTHEST_M
    foot = np.column_stack([ground[seen], np.zeros(int(seen.sum()))])
    points, heights, there = [], [], []
    for height in _HEIGHTS_M:
        top = foot + np.array([0.0, 0.0, height])
        ends = [camera.project(place) for camera in (own, common) for place in (foot, top)]
        (a0, _), (a1, _), (b0, depth), (b1, above) = ends
        size = np.array([common.width, common.height])
        good = (depth > 0) & (above > 0) & (b0 > -0.5 * size).all(axis=1) & (b0 < 1.5 * size).all(axis=1)
        points.append((0.5 * (a0 + a1))[good])
        heights.append((a0 - a1)[good, 1])
        there.append((0.5 * (b0 + b1))[good])
    xy, tall, other = np.concatenate(points), np.concatenate(heights), np.concatenate(there)
    if len(xy) < _LEAST_BOXES:
        raise DataError("the cameras do not see the same road: are both in the same axes?")
    way = fit_with_parallax(xy, tall, other)
    left = float(np.sqrt(np.mean(np.square(way.points(xy, tall) - other).sum(axis=1) / 2.0)))
    # What is left is as if the map were shifted by so much.
    covariance = np.zeros((11, 11))
    covariance[2, 2] = covariance[6, 6] = left**2
    return PictureMap(way.matrix, covariance), left
