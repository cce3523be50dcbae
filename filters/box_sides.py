"""Extended Kalman filter of boxes: a detection measures the four sides of its box.

Along each axis a box has the sides z = p + b ∓ e^(l + c) / 2, so with w = e^(l + c)

    H = ∂z/∂[p, v, a, l, r, b, c] = [[1, 0, 0, −w/2, 0, 1, −w/2], [1, 0, 0, +w/2, 0, 1, +w/2]],   R = r I₂.

Errors have heavy tails (Student's t, Roth, Özkan and Gustafsson, ICASSP 2013: R is divided by the weight
(ν + 4)/(ν + d²)), and an occluder may cut one side inwards, whose error says nothing of the object: both
sides measure, or only the left, or only the right one (a mixture, whose probabilities divide R side by side).
Where a detector's boxes end at the edge of the picture, a side there that lies inwards of what is expected
measures nothing but that the object reaches as far (`unmeasured_sides`). Shapes: N tracks, M boxes; axis 0
is x, side 0 is left or top; boxes here are left, top, right, bottom (px).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.filters.singer import (
    ACCELERATION,
    GROWTH,
    LOG_SIZE,
    POSITION,
    POSITION_ERROR,
    SIZE_ERROR,
    STATES,
    VELOCITY,
    box_size,
    expected_centre,
    expected_size,
    lasting_error,
)

SIDES = 4
# A smaller area is none (px²).
_LEAST_AREA = 1e-9
# Probabilities and weights are kept from 0, lest R be infinite.
_LEAST_PROBABILITY, _LEAST_WEIGHT = 0.02, 1e-3
# ln of the probability that an occluder moves a side outwards, and the largest d² whose weight is computed.
_OUTWARDS, _MOST_DISTANCE = -20.0, 200.0
# Standard deviation of a side that measures nothing (sizes).
_UNMEASURED = 100.0
_LOG_2PI = math.log(2.0 * math.pi)


class SideInnovations(NamedTuple):
    """Of each box from each track.

    Attributes:
        y: (N, M, 2, 2) innovation by axis and side (px).
        S: (N, M, 2, 2, 2) its covariance by axis; sides that the edge of the picture cuts vary with the size.
        d2: (N, M, 2) squared Mahalanobis distance by axis.
        H: (N, 2, 2, 7) measurement matrix by axis.
        side_variance: (N, M, 2, 2) variance of the measured sides (px²).
        unmeasured: (N, M, 2, 2) sides that measure nothing.
    """

    y: FloatArray
    S: FloatArray
    d2: FloatArray
    H: FloatArray
    side_variance: FloatArray
    unmeasured: BoolArray


def corners(mean: FloatArray) -> FloatArray:
    """Return the boxes (N, 4) left, top, right, bottom of states (N, 2, 7)."""
    half = box_size(mean) / 2.0
    centre = mean[:, :, POSITION]
    return np.concatenate([centre - half, centre + half], axis=1)


def expected_corners(mean: FloatArray) -> FloatArray:
    """Return the boxes (N, 4) that a detector is expected to give, with the errors that last."""
    half, centre = expected_size(mean) / 2.0, expected_centre(mean)
    return np.concatenate([centre - half, centre + half], axis=1)


def intersection_over_union(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the IoU (N, M) of boxes (N, 4) and (M, 4) left, top, right, bottom."""
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum(a[:, None, 2:], b[None, :, 2:])
    common = np.clip(high - low, 0.0, None).prod(axis=2)
    areas = (a[:, 2:] - a[:, :2]).prod(axis=1)[:, None] + (b[:, 2:] - b[:, :2]).prod(axis=1)[None]
    return np.asarray(common / np.maximum(areas - common, _LEAST_AREA))


def side_variance(size: FloatArray, log_variance: float, c: ModelConstants) -> FloatArray:
    """Return the variance (N, 2) of one measured side (px²): ρ² (½ √(w h) + ½ w)² + σ_px².

    Args:
        size: (N, 2) width and height (px).
        log_variance: ln ρ² of the sensor.
        c: constants.
    """
    both = np.sqrt(size.prod(axis=1))[:, None]
    return np.asarray(math.exp(log_variance) * (0.5 * both + 0.5 * size) ** 2 + c.pixel_std**2)


def measurement_matrix(size: FloatArray) -> FloatArray:
    """Return H (N, 2, 2, 7): derivatives of both sides of each axis by its state."""
    H = np.zeros((len(size), 2, 2, STATES))
    H[..., POSITION] = H[..., POSITION_ERROR] = 1.0
    for length in (LOG_SIZE, SIZE_ERROR):
        H[:, :, 0, length], H[:, :, 1, length] = -size / 2.0, size / 2.0
    return H


def by_axis(boxes: FloatArray) -> FloatArray:
    """Return boxes (M, 4) left, top, right, bottom as (M, 2, 2) by axis and side."""
    return boxes.reshape(-1, 2, 2).transpose(0, 2, 1)


def squared_distance(y: FloatArray, S: FloatArray) -> FloatArray:
    """Return yᵀ S⁻¹ y by axis.

    Args:
        y: (..., 2, 2) innovation by axis and side.
        S: (..., 2, 2, 2) covariance, of a shape that fits.
    """
    a, b, d = S[..., 0, 0], S[..., 0, 1], S[..., 1, 1]
    left, right = y[..., 0], y[..., 1]
    return np.asarray((left**2 * d + right**2 * a - 2.0 * left * right * b) / (a * d - b**2))


def determinant(S: FloatArray) -> FloatArray:
    """Return the determinant (...) of matrices (..., 2, 2)."""
    return np.asarray(S[..., 0, 0] * S[..., 1, 1] - S[..., 0, 1] ** 2)


def with_variance(S: FloatArray, left: FloatArray, right: FloatArray) -> FloatArray:
    """Return matrices (..., 2, 2) with variances (...) added to their diagonals."""
    out = S.copy()
    out[..., 0, 0] += left
    out[..., 1, 1] += right
    return out


def innovations(
    mean: FloatArray,
    covariance: FloatArray,
    boxes: FloatArray,
    edges: BoolArray,
    log_variance: float,
    c: ModelConstants,
    spread: FloatArray | None = None,
) -> SideInnovations:
    """Compare boxes (M, 4) with tracks: y = z − h(m), S = H P Hᵀ + R.

    Args:
        mean: (N, 2, 7) predicted states.
        covariance: (N, 2, 7, 7).
        boxes: (M, 4) left, top, right, bottom (px).
        edges: (M, 2, 2) which of their sides lie at the edge of the picture.
        log_variance: ln ρ² of the sensor's sides.
        c: constants.
        spread: (N, M, 2, 2) what R of a side is more where the detector says it (`box_spread`, px²), or None.
    """
    size = expected_size(mean)
    H, R = measurement_matrix(size), side_variance(size, log_variance, c)
    S = with_variance(H @ covariance @ H.transpose(0, 1, 3, 2), R, R)
    y = by_axis(boxes)[None] - by_axis(expected_corners(mean))[:, None]
    unmeasured = unmeasured_sides(y, edges)
    more = cut_variance(unmeasured, size[:, None], c)
    of_side = np.repeat(np.repeat(R[:, None, :, None], len(boxes), axis=1), 2, axis=3)
    of_side, more = (of_side, more) if spread is None else (of_side + spread, more + spread)
    S = with_variance(np.repeat(S[:, None], len(boxes), axis=1), more[..., 0], more[..., 1])
    return SideInnovations(y, S, squared_distance(y, S), H, of_side, unmeasured)


def at_edge(boxes: FloatArray, picture: tuple[float, float], c: ModelConstants) -> BoolArray:
    """Return which sides (M, 2, 2) of boxes (M, 4), by axis and side, lie at the edge of the picture."""
    edge = np.array([[0.0, picture[0]], [0.0, picture[1]]])
    return np.asarray(np.abs(by_axis(boxes) - edge) <= c.edge_px)


def beyond_edge(boxes: FloatArray, picture: tuple[float, float], c: ModelConstants) -> BoolArray:
    """Return which boxes (M, 4) reach beyond the picture."""
    out = np.concatenate([-boxes[:, :2], boxes[:, 2:] - np.array(picture)], axis=1)
    return np.asarray(out.max(axis=1, initial=-np.inf) > c.edge_px)


def unmeasured_sides(y: FloatArray, edges: BoolArray) -> BoolArray:
    """Return which sides (..., 2, 2) measure nothing: those at the edge, inwards of the expected ones.

    Args:
        y: (..., 2, 2) innovations by axis and side.
        edges: of a shape that fits, which sides lie at the edge.
    """
    inwards = np.stack([y[..., 0] > 0.0, y[..., 1] < 0.0], axis=-1)
    return np.asarray(inwards & edges)


def cut_variance(cut: BoolArray, size: FloatArray, c: ModelConstants) -> FloatArray:
    """Return the variance (..., 2, 2) of sides that the edge has cut: they lie anywhere within the object.

    A normal density of the standard deviation `edge_std` w has about the height 1/w at 0.

    Args:
        cut: (..., 2, 2) which sides.
        size: (..., 2) width and height (px).
        c: constants.
    """
    return np.asarray(np.where(cut, (c.edge_std * size[..., None]) ** 2, 0.0))


def student_weight(d2: FloatArray, c: ModelConstants) -> FloatArray:
    """Return the weight (ν + 4)/(ν + d²) (N,) of four sides, at most 1; d² (N,)."""
    nu = c.degrees_of_freedom
    weight = (nu + SIDES) / (nu + np.minimum(d2, _MOST_DISTANCE))
    return np.asarray(np.clip(weight, _LEAST_WEIGHT, 1.0))


def cut_probabilities(y: FloatArray, S: FloatArray, size: FloatArray, c: ModelConstants) -> FloatArray:
    """Return the probability (N, 2, 2) by axis and side that this side is cut, and the other is not.

    Where both measure, y ~ N(0, S). Where an occluder cuts one (prior ε), the other is N(0, S_ii) and the cut
    one lies anywhere inwards within the object: density 1/w.

    Args:
        y: (N, 2, 2) innovations.
        S: (N, 2, 2, 2) their covariances.
        size: (N, 2) width and height (px).
        c: constants.
    """
    both = -0.5 * squared_distance(y, S) - 0.5 * np.log(determinant(S)) - _LOG_2PI
    variance = np.diagonal(S, axis1=2, axis2=3)
    alone = -0.5 * y**2 / variance - 0.5 * (np.log(variance) + _LOG_2PI)
    other = alone[..., ::-1] - np.log(size)[..., None] + math.log(c.cut_share)
    inwards = np.stack([y[..., 0] > 0.0, y[..., 1] < 0.0], axis=-1)
    cut = other + np.where(inwards, 0.0, _OUTWARDS)
    total = np.logaddexp(np.logaddexp(both, cut[..., 1]), cut[..., 0])
    return np.asarray(np.exp(cut - total[..., None]))


def measured_variance(
    y: FloatArray,
    S: FloatArray,
    R: FloatArray,
    size: FloatArray,
    unmeasured: BoolArray,
    c: ModelConstants,
) -> FloatArray:
    """Return the variance (N, 2, 2) by axis and side with which an update takes each side (px²).

    Args:
        y: (N, 2, 2) innovations.
        S: (N, 2, 2, 2) their covariances.
        R: (N, 2, 2) variances of the sides as assumed (px²).
        size: (N, 2) width and height (px).
        unmeasured: (N, 2, 2) sides that measure nothing.
        c: constants.
    """
    heavy = 1.0 / student_weight(squared_distance(y, S).sum(axis=1), c)
    cut = cut_probabilities(y, S, size, c)
    # Where a cut explains the innovation, what is left fits and has no heavy tail.
    tail = np.where(cut.sum(axis=2) > 0.5, 1.0, heavy[:, None])
    variance = R * tail[..., None] / np.maximum(1.0 - cut, _LEAST_PROBABILITY)
    return np.asarray(np.where(unmeasured, ((_UNMEASURED * size) ** 2)[..., None], variance))


def uncover(
    mean: FloatArray,
    covariance: FloatArray,
    y: FloatArray,
    S: FloatArray,
    unmeasured: BoolArray,
    c: ModelConstants,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return states, covariances and innovations that know nothing of sides which had been cut so far.

    Where a side lies further out than predicted, and that it was cut (prior ε', density 1/w) is likelier than
    that both sides measure as before, the state takes it as it is measured, d further out, and the covariance
    becomes P + d² ∂ ∂ᵀ, with ∂[p, l] = [1/2, ∓1/w].

    Args:
        mean: (N, 2, 7) predicted states.
        covariance: (N, 2, 7, 7).
        y: (N, 2, 2) innovations by axis and side.
        S: (N, 2, 2, 2) their covariances.
        unmeasured: (N, 2, 2) sides that measure nothing; their axes stay as they are.
        c: constants.
    """
    mean, covariance, left_over, size = mean.copy(), covariance.copy(), y.copy(), expected_size(mean)
    both = -0.5 * squared_distance(y, S) - 0.5 * np.log(determinant(S)) - _LOG_2PI
    variance = np.diagonal(S, axis1=2, axis2=3)
    alone = -0.5 * y**2 / variance - 0.5 * (np.log(variance) + _LOG_2PI)
    other = alone[..., ::-1] - np.log(size)[..., None] + math.log(c.uncovered_share)
    out = np.stack([-y[..., 0], y[..., 1]], axis=-1)
    shows = (out > 0.0) & (out < c.most_uncovered * size[..., None]) & (other > both[..., None])
    shows &= ~unmeasured.any(axis=2, keepdims=True)
    for side, sign in enumerate((-1.0, 1.0)):
        d = np.where(shows[..., side], out[..., side], 0.0)
        whole = expected_size(mean) + d
        mean[..., POSITION] += sign * d / 2.0
        known = np.log(whole) - mean[..., SIZE_ERROR]
        mean[..., LOG_SIZE] = np.where(shows[..., side], known, mean[..., LOG_SIZE])
        left_over[..., side] = np.where(shows[..., side], 0.0, y[..., side])
        covariance += variance_along_side(d, sign / whole)
    return mean, covariance, left_over


def variance_along_side(d: FloatArray, along: FloatArray) -> FloatArray:
    """Return d² ∂ ∂ᵀ (N, 2, 7, 7), ∂[p, l] = [1/2, along]: what a side that is off by d (N, 2) adds to P."""
    direction = np.zeros((*d.shape, STATES))
    direction[..., POSITION], direction[..., LOG_SIZE] = 0.5, along
    return np.asarray((d**2)[..., None, None] * direction[..., :, None] * direction[..., None, :])


def update(
    mean: FloatArray, covariance: FloatArray, y: FloatArray, H: FloatArray, R: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Update states by their boxes, in Joseph's form: P = (I − K H) P (I − K H)ᵀ + K R Kᵀ.

    Args:
        mean: (N, 2, 7) predicted states.
        covariance: (N, 2, 7, 7).
        y: (N, 2, 2) innovations.
        H: (N, 2, 2, 7) measurement matrices.
        R: (N, 2, 2) variances of the sides (px²).
    """
    Ht = H.transpose(0, 1, 3, 2)
    S = with_variance(H @ covariance @ Ht, R[..., 0], R[..., 1])
    K = covariance @ Ht @ np.linalg.inv(S)
    rest = np.eye(STATES) - K @ H
    noise = (K * R[..., None, :]) @ K.transpose(0, 1, 3, 2)
    return mean + (K @ y[..., None])[..., 0], rest @ covariance @ rest.transpose(0, 1, 3, 2) + noise


def initial_state(
    boxes: FloatArray,
    edges: BoolArray,
    log_variance: float,
    scene: float,
    c: ModelConstants,
    spread: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return mean (M, 2, 7) and covariance (M, 2, 7, 7) of tracks that begin at boxes.

    Args:
        boxes: (M, 4) left, top, right, bottom (px).
        edges: (M, 2, 2) sides at the edge of the picture: how far the object reaches beyond it nobody knows.
        log_variance: ln ρ² of the sensor's sides.
        scene: the same of all sensors, for the errors that last.
        c: constants.
        spread: (M, 2, 2) what the variance of a side is more where the detector says it (px²), or None.
    """
    size = boxes[:, 2:] - boxes[:, :2]
    R, scale = side_variance(size, log_variance, c), np.sqrt(size.prod(axis=1))[:, None]
    mean = np.zeros((len(boxes), 2, STATES))
    mean[:, :, POSITION], mean[:, :, LOG_SIZE] = (boxes[:, :2] + boxes[:, 2:]) / 2.0, np.log(size)
    covariance = np.zeros((len(boxes), 2, STATES, STATES))
    covariance[..., POSITION, POSITION] = R / 2.0
    covariance[..., VELOCITY, VELOCITY] = (c.velocity_std * scale) ** 2
    covariance[..., ACCELERATION, ACCELERATION] = (c.acceleration_std * scale) ** 2
    covariance[..., LOG_SIZE, LOG_SIZE] = 2.0 * R / size**2
    if spread is not None:
        first, last = R + spread[..., 0], R + spread[..., 1]
        covariance[..., POSITION, POSITION] = (first + last) / 4.0
        covariance[..., LOG_SIZE, LOG_SIZE] = (first + last) / size**2
        covariance[..., POSITION, LOG_SIZE] = covariance[..., LOG_SIZE, POSITION] = (last - first) / (
            2.0 * size
        )
    covariance[..., GROWTH, GROWTH] = c.growth_std**2
    errors = lasting_error(size, scene, c)
    covariance[..., POSITION_ERROR, POSITION_ERROR], covariance[..., SIZE_ERROR, SIZE_ERROR] = errors
    for side, sign in enumerate((-1.0, 1.0)):
        covariance += variance_along_side(np.where(edges[..., side], c.edge_birth * size, 0.0), sign / size)
    return mean, covariance
