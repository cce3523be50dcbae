"""How what was found of a vehicle moves with the camera's parameters: what a wrong one would change."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from jeat_graph.core import road as core
from jeat_graph.data.arrays import FloatArray
from jeat_graph.road.box_errors import BoxRows, whiten
from jeat_graph.road.camera import PARAMETERS, RoadCamera

_CALIBRATION_STEP = 1e-3  # in standard deviations of each parameter, where it has one


def residual_slopes(camera: RoadCamera, residual: Callable[[core.Camera], FloatArray]) -> FloatArray:
    """Derivatives (..., 12) of residuals with respect to the camera's parameters, zero for exact ones."""
    spread = np.sqrt(np.diag(camera.covariance))
    slopes = np.zeros((*residual(camera.compiled()).shape, len(PARAMETERS)))
    for k in np.flatnonzero(spread > 0):
        change = np.zeros(len(PARAMETERS))
        change[k] = _CALIBRATION_STEP * spread[k]
        more, less = (residual(camera.moved(sign * change).compiled()) for sign in (1.0, -1.0))
        slopes[..., k] = (more - less) / (2.0 * change[k])
    return slopes


def calibration_effect(
    columns: FloatArray, slopes: FloatArray, rows: BoxRows, weight: FloatArray, covariance: FloatArray
) -> FloatArray:
    """Derivative (P, 12) of the unknowns with respect to the camera's parameters.

    Args:
        columns: (N, 4, P) derivatives of what is measured with respect to the unknowns.
        slopes: (N, 4, 12) of the residuals with respect to the camera's parameters.
        rows: the boxes.
        weight: (N,) robust weights of the boxes.
        covariance: (P, P) of the unknowns.
    """
    P = columns.shape[-1]
    white = np.concatenate([columns, slopes], axis=-1)
    whiten(white, rows, weight)
    flat = white.reshape(-1, white.shape[2])
    return np.asarray(covariance @ (flat[:, :P].T @ flat[:, P:]), dtype=np.float64)
