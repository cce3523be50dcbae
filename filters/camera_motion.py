"""Motion of the camera between two scans: a shift and a scale that all tracks have in common.

Innovations of the centres of confirmed tracks are y = A θ + e, θ = (shift x, shift y, scale), one row of A an
axis: [1, 0, x − W/2] and [0, 1, y − H/2]. θ ~ N(0, C) with a learnt C, e ~ t(ν, S): iteratively reweighted
least squares (Lange, Little and Taylor, *Robust statistical modeling using the t distribution*, JASA 1989).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.filters.box_sides import side_variance
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.filters.singer import (
    GROWTH,
    LOG_SIZE,
    POSITION,
    POSITION_ERROR,
    SIZE_ERROR,
    VELOCITY,
    expected_centre,
    expected_size,
)

# Tracks and boxes are paired by position and ln size, four numbers, with this gate (χ², 98 %).
_GATE = 12.0
# Allowance for the camera's own motion when pairing: three standard deviations, at most this variance
# (sizes²).
_PAIRING_DEVIATIONS, _PAIRING_MOST = 9.0, 0.16
# Degrees of freedom of a track's two coordinates, and the number of reweightings.
_DEGREES, _ITERATIONS = 3.0, 4
# Fewer tracks tell nothing of a camera.
_LEAST_TRACKS = 2
# So many tracks with a box can speak against what pictures show, if fewer than these tenths have one with it.
_LEAST_WITNESSES, _LEAST_TENTHS = 3, 7


class CameraVariance(NamedTuple):
    """Variances of the motion between two scans: of shift (sizes²), and of scale; and the last motion.

    Attributes:
        shift: (sizes²).
        scale: without a unit.
        last: (3,) the last motion, in θ per second.
    """

    shift: float
    scale: float
    last: FloatArray


class CameraMotion(NamedTuple):
    """Motion of the camera: θ (3,) as shift x, y (px) and scale, and its covariance (3, 3)."""

    theta: FloatArray
    covariance: FloatArray


def initial_variance(c: ModelConstants) -> CameraVariance:
    """Return the variances before anything is learnt."""
    return CameraVariance(c.camera_shift_std**2, c.camera_scale_std**2, np.zeros(3))


def estimate(
    mean: FloatArray,
    covariance: FloatArray,
    boxes: FloatArray,
    log_variance: float,
    picture: tuple[float, float],
    dt: float,
    prior: CameraVariance,
    c: ModelConstants,
) -> tuple[CameraMotion | None, CameraVariance]:
    """Estimate the camera's motion since the last scan.

    Args:
        mean: (N, 2, 7) predicted states of tracks that are surely real.
        covariance: (N, 2, 7, 7).
        boxes: (M, 4) left, top, right, bottom (px).
        log_variance: ln ρ² of the sensor's sides.
        picture: width and height (px).
        dt: time since the tracks' last prediction (s), > 0.
        prior: learnt variances.
        c: constants.

    Returns:
        The motion, or None where too few tracks have a box, and the variances learnt from it.
    """
    if len(mean) < _LEAST_TRACKS or not len(boxes):
        return None, prior
    y, S, wide, d2_size, scale = _compared(mean, covariance, boxes, log_variance, prior, c)
    centre = expected_centre(mean) - np.array(picture) / 2.0
    # The camera may have gone on as before: rows of like objects are else taken for their neighbours.
    again = prior.last[:2] * dt + prior.last[2] * dt * centre
    track, box = _nearest(y**2 / wide, d2_size)
    moved = _nearest((y - again[:, None]) ** 2 / wide, d2_size)
    if len(moved[0]) > len(track):
        track, box = moved
    if len(track) < _LEAST_TRACKS:
        return None, prior
    place = centre[track]
    typical = float(np.median(scale[track]))
    precision = 1.0 / np.array([prior.shift * typical**2, prior.shift * typical**2, prior.scale])
    motion = _reweighted_least_squares(y[track, box], S[track], place, precision)
    return motion, _learnt(prior, motion, typical, dt, c)


def contradicted(
    mean: FloatArray,
    covariance: FloatArray,
    boxes: FloatArray,
    log_variance: float,
    moved: FloatArray,
    prior: CameraVariance,
    c: ModelConstants,
) -> bool:
    """Tell whether boxes speak against a motion that pictures show: far fewer tracks have one with it.

    Args:
        mean: (N, 2, 7) predicted states of tracks that are surely real.
        covariance: (N, 2, 7, 7).
        boxes: (M, 4) left, top, right, bottom (px).
        log_variance: ln ρ² of the sensor's sides.
        moved: (N, 2) how far the motion takes each beyond what was predicted (px).
        prior: learnt variances.
        c: constants.
    """
    if len(mean) < _LEAST_WITNESSES or not len(boxes):
        return False
    y, _, wide, d2_size, _ = _compared(mean, covariance, boxes, log_variance, prior, c)
    without = len(_nearest(y**2 / wide, d2_size)[0])
    paired = len(_nearest((y - moved[:, None]) ** 2 / wide, d2_size)[0])
    return without >= _LEAST_WITNESSES and 10 * paired < _LEAST_TENTHS * without


def lasting_rate(dt: float, c: ModelConstants) -> float:
    """Return the share per second of a motion of `dt` (s), > 0, that goes over to the tracks' velocities."""
    return (1.0 - math.exp(-dt / c.camera_time_s)) / dt


def compensate(
    mean: FloatArray,
    covariance: FloatArray,
    motion: CameraMotion,
    picture: tuple[float, float],
    dt: float,
    c: ModelConstants,
) -> tuple[FloatArray, FloatArray]:
    """Return the states (N, 2, 7) and covariances as the camera sees them after its motion.

    A camera that goes on for ever and tracks that all move cannot be distinguished: θ and the velocities
    could grow against each other without end. So what lasts of θ is theirs: (1 − e^(−Δ/τ)) θ/Δ goes over to
    their velocities and rates of growth, and the mean of θ over more than τ is 0.

    Args:
        mean: (N, 2, 7).
        covariance: (N, 2, 7, 7).
        motion: of the camera.
        picture: width and height (px).
        dt: the time that it took (s), > 0.
        c: constants.
    """
    shift, scale = motion.theta[:2], motion.theta[2]
    lasting = lasting_rate(dt, c)
    mean, covariance = mean.copy(), covariance.copy()
    moved = shift + scale * (mean[:, :, POSITION] - np.array(picture) / 2.0)
    mean[:, :, POSITION] += moved
    mean[:, :, VELOCITY] += lasting * moved
    mean[:, :, LOG_SIZE] += scale
    mean[:, :, GROWTH] += lasting * scale
    covariance[..., POSITION, POSITION] += np.diag(motion.covariance)[:2]
    return mean, covariance


class _Compared(NamedTuple):
    """Boxes (M,) against tracks (N,).

    Attributes:
        y: (N, M, 2) innovations of the centre (px).
        S: (N, 2) their variances.
        wide: (N, 1, 2) these with what the camera may have moved.
        d2_size: (N, M) squared distances of the sizes.
        scale: (N,) sizes of the tracks (px).
    """

    y: FloatArray
    S: FloatArray
    wide: FloatArray
    d2_size: FloatArray
    scale: FloatArray


def _compared(
    mean: FloatArray,
    covariance: FloatArray,
    boxes: FloatArray,
    log_variance: float,
    prior: CameraVariance,
    c: ModelConstants,
) -> _Compared:
    size = expected_size(mean)
    scale = np.sqrt(size.prod(axis=1))
    R = side_variance(size, log_variance, c)
    S = _variance_of_sum(covariance, POSITION, POSITION_ERROR) + R / 2.0
    S_size = _variance_of_sum(covariance, LOG_SIZE, SIZE_ERROR) + 2.0 * R / size**2
    y = (boxes[:, :2] + boxes[:, 2:])[None] / 2.0 - expected_centre(mean)[:, None]
    y_size = np.log(boxes[:, 2:] - boxes[:, :2])[None] - np.log(size)[:, None]
    d2_size = (y_size**2 / S_size[:, None]).sum(axis=2)
    allowance = min(prior.shift * _PAIRING_DEVIATIONS, _PAIRING_MOST) * scale**2
    return _Compared(y, S, (S + allowance[:, None])[:, None], d2_size, scale)


def _variance_of_sum(covariance: FloatArray, i: int, j: int) -> FloatArray:
    """Return the variance (N, 2) by axis of the sum of two states."""
    return np.asarray(covariance[..., i, i] + 2.0 * covariance[..., i, j] + covariance[..., j, j])


def _nearest(d2: FloatArray, d2_size: FloatArray) -> tuple[IntArray, IntArray]:
    """Return tracks (K,) and boxes (K,) that are each other's nearest, within the gate.

    Args:
        d2: (N, M, 2) squared distances of the centres by axis.
        d2_size: (N, M) of the sizes.
    """
    near = d2.sum(axis=2)
    total = np.where(near < _GATE, near + d2_size, np.inf)
    box, track = total.argmin(axis=1), np.arange(len(total))
    paired = (total[track, box] < _GATE) & (total[:, box].argmin(axis=0) == track)
    return track[paired], box[paired]


def _reweighted_least_squares(
    y: FloatArray, S: FloatArray, place: FloatArray, precision: FloatArray
) -> CameraMotion:
    """Solve for θ; y, S, place (K, 2): innovations (px), variances, places from the middle."""
    A = np.zeros((2 * len(y), 3))
    A[::2, 0] = A[1::2, 1] = 1.0
    A[::2, 2], A[1::2, 2] = place[:, 0], place[:, 1]
    flat, variance = y.reshape(-1), S.reshape(-1)
    theta: FloatArray = np.zeros(3)
    covariance: FloatArray = np.diag(1.0 / precision)
    for _ in range(_ITERATIONS):
        d2 = ((flat - A @ theta) ** 2 / variance).reshape(-1, 2).sum(axis=1)
        weight = np.repeat((_DEGREES + 2.0) / (_DEGREES + d2), 2) / variance
        information: FloatArray = (A * weight[:, None]).T @ A + np.diag(precision)
        covariance = np.linalg.inv(information).astype(np.float64)
        theta = covariance @ ((A * weight[:, None]).T @ flat)
    return CameraMotion(theta, covariance)


def _learnt(
    prior: CameraVariance, motion: CameraMotion, typical: float, dt: float, c: ModelConstants
) -> CameraVariance:
    """Return the variances after a scan: running means of E[θ²], within their bounds; and the motion."""
    second = motion.theta**2 + np.diag(motion.covariance)
    keep = c.camera_memory
    shift = keep * prior.shift + (1.0 - keep) * float(second[:2].mean()) / typical**2
    scale = keep * prior.scale + (1.0 - keep) * float(second[2])
    low, high = c.camera_shift_bounds, c.camera_scale_bounds
    return CameraVariance(
        float(np.clip(shift, low[0] ** 2, low[1] ** 2)),
        float(np.clip(scale, high[0] ** 2, high[1] ** 2)),
        motion.theta / dt,
    )
