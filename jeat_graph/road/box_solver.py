"""Compiled least squares over one vehicle's boxes: its motion and its length, width and height together.

Each sensor's error is white noise and a first-order Gauss-Markov process. Such a sum is whitened exactly by
the innovations of a scalar Kalman filter of that process, in time that grows with the number of boxes alone:
the filter is linear, so that residuals and columns of the Jacobian go through it alike.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.road.box_kernel import (
    CHANNELS,
    NEITHER,
    UNKNOWNS,
    WHOLE,
    KernelCamera,
    box_channels,
    cuboid_sides,
)

_STEPS = 14
_PLAIN_STEPS = 2
_SETTLED = 0.02
_LEAST_SHARE = 0.3  # of a size before a step that may be left after it


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


@njit(cache=True)
def measured(row_mode: IntArray, channel: int) -> bool:
    """Tell whether a channel of a box counts."""
    if channel < 2:
        return bool(row_mode[channel] != NEITHER)
    return bool(row_mode[channel - 2] == WHOLE)


@njit(cache=True)
def whiten(columns: FloatArray, rows: BoxRows, weight: FloatArray) -> float:
    """Whiten columns (N, 4, Q) in place; rows that are not measured become zero.

    Args:
        columns: residuals and derivatives.
        rows: the boxes with the sizes of their errors.
        weight: (N,) robust weights: a doubtful box is given more white noise.

    Returns:
        Logarithm of the determinant of the errors' covariance.
    """
    N, Q = columns.shape[0], columns.shape[2]
    log_determinant = 0.0
    expected = np.empty(Q)
    for channel in range(CHANNELS):
        for g in range(len(rows.memory_s)):
            variance, last = 1.0, -np.inf
            expected[:] = 0.0
            for k in range(N):
                if rows.group[k] != g:
                    continue
                if not measured(rows.mode[k], channel):
                    columns[k, channel] = 0.0
                    continue
                if last > -np.inf:
                    forget = math.exp(-(rows.t[k] - last) / rows.memory_s[g])
                    variance = 1.0 + forget * forget * (variance - 1.0)
                    for q in range(Q):
                        expected[q] *= forget
                last = rows.t[k]
                h, white = rows.coloured[k, channel], rows.white[k, channel]
                white += (white + h * h) * (1.0 / max(weight[k], 1e-6) - 1.0)
                S = h * h * variance + white
                root, gain = 1.0 / math.sqrt(S), variance * h / S
                log_determinant += math.log(S)
                for q in range(Q):
                    innovation = columns[k, channel, q] - h * expected[q]
                    expected[q] += gain * innovation
                    columns[k, channel, q] = innovation * root
                variance -= gain * h * variance
    return log_determinant


@njit(cache=True)
def linearise(
    camera: KernelCamera, rows: BoxRows, motion: Motion, theta: FloatArray, columns: FloatArray
) -> bool:
    """Fill columns (N, 4, P + 1) with the derivatives of the channels and, last, the residuals.

    Returns:
        Whether the vehicle is in front of the camera at all times.
    """
    N, C = motion.basis.shape
    P = 2 * C + 3
    side, slope = np.empty(4), np.empty((4, UNKNOWNS))
    z, J = np.empty(CHANNELS), np.empty((CHANNELS, UNKNOWNS))
    size = theta[2 * C : P]
    for k in range(N):
        x = y = vx = vy = 0.0
        for c in range(C):
            x += motion.basis[k, c] * theta[c]
            y += motion.basis[k, c] * theta[C + c]
            vx += motion.rate[k, c] * theta[c]
            vy += motion.rate[k, c] * theta[C + c]
        heading = motion.along
        if vx * vx + vy * vy > motion.least_speed**2:
            heading = math.atan2(vx, vy)
        if not cuboid_sides(camera, x, y, heading, size, side, slope):
            return False
        box_channels(side, slope, rows.mode[k], z, J)
        for channel in range(CHANNELS):
            for c in range(C):
                columns[k, channel, c] = J[channel, 0] * motion.basis[k, c]
                columns[k, channel, C + c] = J[channel, 1] * motion.basis[k, c]
            for c in range(3):
                columns[k, channel, 2 * C + c] = J[channel, 2 + c]
            columns[k, channel, P] = rows.z[k, channel] - z[channel]
    return True


@njit(cache=True)
def robust_weights(columns: FloatArray, rows: BoxRows, soft: float, weight: FloatArray) -> None:
    """Geman and McClure's weights of the boxes by their residuals (last column), not yet whitened."""
    Q = columns.shape[2]
    for k in range(len(weight)):
        total, count = 0.0, 0
        for channel in range(CHANNELS):
            if measured(rows.mode[k], channel):
                spread = rows.white[k, channel] + rows.coloured[k, channel] ** 2
                total += columns[k, channel, Q - 1] ** 2 / spread
                count += 1
        mean = total / max(count, 1)
        weight[k] = 1.0 / (1.0 + mean / (soft * soft)) ** 2


@njit(cache=True)
def solve_boxes(
    camera: KernelCamera,
    rows: BoxRows,
    motion: Motion,
    start: FloatArray,
    prior_mean: FloatArray,
    precision: FloatArray,
    soft: float,
    weight: FloatArray,
) -> tuple[bool, FloatArray, FloatArray, float, float]:
    """Gauss-Newton over the coefficients of the motion and the size.

    Args:
        camera: the camera.
        rows: the boxes.
        motion: the basis.
        start: (P,) coefficients of x, of y, then length, width, height.
        prior_mean: (P,) and
        precision: (P, P) what is believed before.
        soft: residual in standard deviations at which a box's weight is a quarter.
        weight: (N,) robust weights, changed in place.

    Returns:
        Whether it settled at a vehicle, the unknowns (P,), the normal matrix (P, P), minus twice the log
        likelihood with the prior's part, and the mean square of the whitened residuals.
    """
    N, P = len(rows.t), len(start)
    theta = start.copy()
    normal = precision.copy()
    columns = np.empty((N, CHANNELS, P + 1))
    cost, chi2 = np.inf, np.inf
    for k in range(_STEPS):
        if not linearise(camera, rows, motion, theta, columns):
            return False, theta, normal, np.inf, np.inf
        if k >= _PLAIN_STEPS:
            robust_weights(columns, rows, soft, weight)
        log_determinant = whiten(columns, rows, weight)
        flat = columns.reshape(N * CHANNELS, P + 1)
        full = flat.T @ flat
        off = prior_mean - theta
        normal = full[:P, :P] + precision
        pull = precision @ off
        step = np.linalg.solve(normal, full[:P, P] + pull)
        cost = full[P, P] + log_determinant + off @ pull
        chi2 = full[P, P] / max(np.sum(weight) * CHANNELS - P, 1.0)
        # A size never changes its sign: halve a step that would.
        factor = 1.0
        for c in range(P - 3, P):
            while theta[c] + factor * step[c] < _LEAST_SHARE * theta[c]:
                factor *= 0.5
        theta = theta + factor * step
        if k > _PLAIN_STEPS and step @ (normal @ step) < _SETTLED * _SETTLED * P and factor == 1.0:
            return True, theta, normal, cost, chi2
    return bool(np.all(np.isfinite(theta))), theta, normal, cost, chi2
