"""`points.csv` of `register`: what is the same place in the pictures of two sensors."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.picture_map import PictureMap
from jeat_graph.io.tables.file_tables import read_table
from jeat_graph.rig.homography import LEAST_POINTS, covariance_of_fit, fit_homography

# What was clicked is never more exact than this (px).
_CLICKED_PX = 0.5
# A map that leaves more than this share of the picture's width between its points is none.
_MOST_LEFT = 0.02
# Four points fit exactly, whatever they are.
_WISHED_POINTS = 6


def read_points(path: str | Path, names: tuple[str, str]) -> tuple[FloatArray, FloatArray]:
    """Read corresponding points (N, 2) of two sensors (px): columns such as `rgb_x, rgb_y, evt_x, evt_y`.

    Raises:
        DataError: no such columns, or values that are no numbers.
    """
    columns = [f"{name}_{axis}" for name in names for axis in "xy"]
    table = read_table(path, tuple(columns))
    values = np.column_stack([table.number(column) for column in columns])
    return values[:, :2], values[:, 2:]


def map_of_points(
    first: FloatArray, second: FloatArray, size: tuple[float, float], path: str | Path
) -> tuple[PictureMap, list[str]]:
    """Fit the map from the second's points to the first's.

    Args:
        first: (N, 2) in the common picture (px).
        second: (N, 2) in the other (px).
        size: width and height of the common picture (px).
        path: where the points are from, for messages.

    Returns:
        The map with covariance, and lines to be reported.

    Raises:
        DataError: they tell no map, or do not fit together.
    """
    try:
        way = fit_homography(second, first)
    except DataError as error:
        raise DataError(error.message, path) from None
    left = np.linalg.norm(way.points(second) - first, axis=1)
    rms = float(np.sqrt(np.mean(left**2)))
    if rms > _MOST_LEFT * size[0]:
        worst = int(left.argmax())
        raise DataError(
            f"the points do not fit together: {rms:.1f} px are left between them, most at the "
            f"{worst + 1}th, {left[worst]:.1f} px",
            path,
        )
    way = covariance_of_fit(way, second, first, _CLICKED_PX)
    lines = [f"{len(first)} points, {rms:.2g} px left between them"]
    if len(first) == LEAST_POINTS:
        lines.append(
            f"four points fit whatever they are: give {_WISHED_POINTS} or more to see whether they are right"
        )
    return way, lines
