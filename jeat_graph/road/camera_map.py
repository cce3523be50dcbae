"""The way from one calibrated camera's picture into another's, for what stands on the road below both."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.picture_map import PictureMap
from jeat_graph.rig.homography import fit_with_parallax
from jeat_graph.road.camera import RoadCamera

# Vehicles by which the map is fitted: along the road, at so many columns and rows of the picture, as far as
# there is road (m); length, width, height (m) of a car, a van and a lorry.
_COLUMNS, _ROWS, _FARTHEST_M = 13, 16, 150.0
_VEHICLES = ((4.5, 1.8, 1.5), (5.5, 2.0, 2.4), (11.0, 2.5, 3.6))
_NEAREST_M = 1.0
_LEAST_BOXES = 30


def map_between(own: RoadCamera, common: RoadCamera) -> tuple[PictureMap, float]:
    """Return the map with parallax that is nearest to two cameras for vehicles, and what it leaves (rms, px).

    Args:
        own: the camera whose boxes are mapped.
        common: the camera of the common picture; both with the same axes of the road, y along it.

    Raises:
        DataError: they do not see the same road.
    """
    columns = (np.arange(_COLUMNS) + 0.5) / _COLUMNS * own.width
    rows = (np.arange(_ROWS) + 0.5) / _ROWS * own.height
    ground = own.to_road(np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2))
    seen = np.isfinite(ground).all(axis=1)
    seen &= np.hypot(ground[:, 0] - own.position[0], ground[:, 1] - own.position[1]) < _FARTHEST_M
    middle = np.column_stack([ground[seen], np.zeros(int(seen.sum()))])
    points, heights, there = [], [], []
    for length, width, height in _VEHICLES:
        corners = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)])
        places = middle[:, None, :] + corners * [width, length, height]
        (mine, size, whole), (theirs, _, seen_whole) = (_boxes(one, places) for one in (own, common))
        good = whole & seen_whole
        points.append(mine[good])
        heights.append(size[good, 1])
        there.append(theirs[good])
    xy, tall, other = np.concatenate(points), np.concatenate(heights), np.concatenate(there)
    if len(xy) < _LEAST_BOXES:
        raise DataError("the cameras do not see the same road: are both in the same axes?")
    way = fit_with_parallax(xy, tall, other)
    left = float(np.sqrt(np.mean(np.square(way.points(xy, tall) - other).sum(axis=1) / 2.0)))
    # What is left is as if the map were shifted by so much.
    covariance = np.zeros((11, 11))
    covariance[2, 2] = covariance[6, 6] = left**2
    return PictureMap(way.matrix, covariance), left


def _boxes(camera: RoadCamera, places: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Boxes around corners (N, 8, 3): centres (N, 2), sizes (N, 2), and (N,) which the picture has all of."""
    pixels, depth = camera.project(places)
    low, high = pixels.min(axis=1), pixels.max(axis=1)
    whole = (depth > _NEAREST_M).all(axis=1) & (low > 0.0).all(axis=1)
    whole &= (high < np.array([camera.width, camera.height])).all(axis=1)
    return 0.5 * (low + high), high - low, np.asarray(whole)
