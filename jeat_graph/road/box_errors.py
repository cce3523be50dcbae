"""Errors of one vehicle's boxes: they are whitened, and boxes that fit badly count less.

Each sensor's error is white noise and a first-order Gauss-Markov process. Such a sum is whitened exactly by
the innovations of a scalar Kalman filter of that process, in time that grows with the number of boxes alone:
the filter is linear, so that residuals and columns of the Jacobian go through it in the same way.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.core import road as core
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.road.box_channels import measured


class BoxRows(NamedTuple):
    """What was measured of one vehicle, N boxes in order of time.

    Attributes:
        t: (N,) time (s).
        z: (N, 4) centre x, y (px), ln width, ln height; a side in the centre's place where one is cut off.
        white: (N, 4) variances of the errors that are new in each box.
        coloured: (N, 4) standard deviations of the errors that persist.
        mode: (N, 2) what of each axis is measured.
        group: (N,) which process the persisting errors belong to: the sensor.
        memory_s: (G,) correlation times (s).
    """

    t: FloatArray
    z: FloatArray
    white: FloatArray
    coloured: FloatArray
    mode: IntArray
    group: IntArray
    memory_s: FloatArray

    def take(self, part: slice) -> BoxRows:
        """Return some of the boxes."""
        return self._each(lambda name: np.ascontiguousarray(getattr(self, name)[part]))

    def followed_by(self, later: BoxRows) -> BoxRows:
        """Return these boxes and later ones, of the same sensors."""
        return self._each(lambda name: np.concatenate([getattr(self, name), getattr(later, name)]))

    def _each(self, change: Callable[[str], Any]) -> BoxRows:
        of_boxes = (name for name in self._fields if name != "memory_s")
        return self._replace(**{name: change(name) for name in of_boxes})


def whiten(columns: FloatArray, rows: BoxRows, weight: FloatArray) -> float:
    """Whiten columns (N, 4, Q) in place; rows that are not measured become zero.

    Args:
        columns: residuals and derivatives.
        rows: the boxes with the sizes of their errors.
        weight: (N,) robust weights: a doubtful box is given more white noise.

    Returns:
        Logarithm of the determinant of the errors' covariance.
    """
    t, _, white, coloured, mode, group, memory_s = rows
    return core.whiten(columns, t, white, coloured, mode, group, memory_s, weight)


def robust_weights(residual: FloatArray, rows: BoxRows, soft: float) -> FloatArray:
    """Geman and McClure's weights (N,) of the boxes by their residuals (N, 4), not yet whitened.

    Args:
        residual: what was measured less what is expected.
        rows: the boxes with the sizes of their errors.
        soft: residual in standard deviations at which a box's weight is a quarter.
    """
    counts = measured(rows.mode)
    squares = np.where(counts, residual**2 / (rows.white + rows.coloured**2), 0.0)
    mean = squares.sum(axis=1) / np.maximum(counts.sum(axis=1), 1)
    return np.asarray((1.0 + mean / soft**2) ** -2.0)
