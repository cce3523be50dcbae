"""Least squares over one vehicle's boxes: its motion and its length, width and height together."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.core import road as core
from jeat_graph.data.arrays import FloatArray
from jeat_graph.road.box_channels import CHANNELS, directions, linearise
from jeat_graph.road.box_errors import BoxRows, robust_weights, whiten

_STEPS = 14
_PLAIN_STEPS = 2
_SETTLED = 0.02
_LEAST_SHARE = 0.3  # of a size before a step that may be left after it


class Motion(NamedTuple):
    """What a trial motion is made of.

    Attributes:
        basis: (N, C) rows that make a place of coefficients.
        rate: (N, C) rows that make a speed.
        along: direction of the road or of the way made good (rad), for a vehicle that hardly moves.
        least_speed: below it the vehicle keeps that direction (m/s).
    """

    basis: FloatArray
    rate: FloatArray
    along: float
    least_speed: float


class Solution(NamedTuple):
    """What Gauss-Newton found.

    Attributes:
        theta: (P,) coefficients of x, of y, then length, width, height.
        normal: (P, P) normal matrix.
        cost: minus twice the log likelihood with the prior's part.
        chi2: mean square of the whitened residuals.
        weight: (N,) robust weights of the boxes.
    """

    theta: FloatArray
    normal: FloatArray
    cost: float
    chi2: float
    weight: FloatArray


def columns_of(camera: core.Camera, rows: BoxRows, motion: Motion, theta: FloatArray) -> FloatArray | None:
    """Derivatives of the channels with respect to the unknowns, and last the residuals: (N, 4, P + 1).

    None where the vehicle is not in front of the camera at all times.
    """
    ways, size = theta[:-3].reshape(2, -1).T, theta[-3:]
    way = directions(motion.rate @ ways, motion.along, motion.least_speed)
    found = linearise(camera, motion.basis @ ways, way, size, rows.z, rows.mode)
    return None if found is None else by_coefficients(*found, motion.basis)


def by_coefficients(slopes: FloatArray, residual: FloatArray, basis: FloatArray) -> FloatArray:
    """Derivatives by the coefficients of a motion and the size, and last the residuals: (N, 4, 2 C + 4).

    Args:
        slopes: (N, 4, 5) derivatives with respect to x, y, length, width, height.
        residual: (N, 4) what was measured less what is expected.
        basis: (N, C) rows that make a place of coefficients.
    """
    C = basis.shape[1]
    out = np.empty((*residual.shape, 2 * C + 4))
    for axis in range(2):
        np.multiply(slopes[..., axis, None], basis[:, None], out=out[..., axis * C : (axis + 1) * C])
    out[..., 2 * C : -1] = slopes[..., 2:]
    out[..., -1] = residual
    return out


def solve_boxes(
    camera: core.Camera,
    rows: BoxRows,
    motion: Motion,
    start: FloatArray,
    prior: tuple[FloatArray, FloatArray],
    soft: float,
) -> Solution | None:
    """Gauss-Newton over the coefficients of the motion and the size.

    Args:
        camera: the camera.
        rows: the boxes.
        motion: the basis.
        start: (P,) coefficients of x, of y, then length, width, height.
        prior: mean (P,) and precision (P, P) of what is believed before.
        soft: residual in standard deviations at which a box's weight is a quarter.

    Returns:
        What was found, settled or not after the last step; None where a trial is not in front of the camera,
        or what is found is not finite.
    """
    P, theta, weight = len(start), start, np.ones(len(rows.t))
    mean, precision = prior
    found: Solution | None = None
    for k in range(_STEPS):
        columns = columns_of(camera, rows, motion, theta)
        if columns is None:
            return None
        if k >= _PLAIN_STEPS:
            weight = robust_weights(columns[..., P], rows, soft)
        log_determinant = whiten(columns, rows, weight)
        flat = columns.reshape(-1, P + 1)
        full = flat.T @ flat
        off = mean - theta
        normal, pull = full[:P, :P] + precision, precision @ off
        step = np.linalg.solve(normal, full[:P, P] + pull)
        cost = float(full[P, P] + log_determinant + off @ pull)
        chi2 = float(full[P, P] / max(weight.sum() * CHANNELS - P, 1.0))
        factor = size_step(theta[-3:], theta[-3:] + step[-3:])
        theta = theta + factor * step
        settled = step @ normal @ step < _SETTLED * _SETTLED * P and factor == 1.0
        found = Solution(theta, normal, cost, chi2, weight)
        if k > _PLAIN_STEPS and settled:
            break
    return found if np.isfinite(theta).all() else None


def size_step(size: FloatArray, target: FloatArray) -> float:
    """Share of a step from one size to another: a size never changes its sign, nor shrinks at once."""
    factor = 1.0
    while (size + factor * (target - size) < _LEAST_SHARE * size).any():
        factor *= 0.5
    return factor
