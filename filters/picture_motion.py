"""Motion of the camera as its pictures show it: what all that stands does between two pictures.

A point x goes to x + d + s (x − c) + φ J (x − c), J = [[0, −1], [1, 0]]: shift d (px), growth s and
rotation φ (rad, from x to y) about the centre c of the points that were followed. About that centre the
errors of a least squares fit of d, s and φ are uncorrelated, so that four variances tell all.

Velocities of tracks are those in the picture, and the camera's is part of them; where tracks are predicted,
it is left out and goes straight on by itself. What tracks cannot know is how it changes, u = θ/Δ − u', with
u' that of the last picture: u is added to their velocities, and u times the time that they have gone on by
the old one to their positions.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.singer import GROWTH, LOG_SIZE, POSITION, VELOCITY

# For so many spans after the last picture its velocity is believed to go on; then it is the tracks'.
_SPANS_KNOWN = 2.0


class PictureMotion(NamedTuple):
    """Motion between two pictures.

    Attributes:
        span_s: time between them (s), > 0.
        centre: (2,) the centre c (px).
        theta: (4,) shift x, y (px), growth, rotation (rad).
        variance: (4,) theirs.
    """

    span_s: float
    centre: FloatArray
    theta: FloatArray
    variance: FloatArray

    @staticmethod
    def of_numbers(numbers: FloatArray) -> PictureMotion:
        """Take one of eleven numbers, in the order of the attributes."""
        return PictureMotion(float(numbers[0]), numbers[1:3], numbers[3:7], numbers[7:])


class CameraVelocity(NamedTuple):
    """The camera's velocity as of the last picture, which is part of the tracks' velocities.

    Attributes:
        centre: (2,) px.
        rate: (4,) shift x, y (px/s), growth (1/s), rotation (rad/s).
        picture_s: time of that picture (s), minus infinity before the first.
        until_s: until when it is believed to go on (s).
    """

    centre: FloatArray
    rate: FloatArray
    picture_s: float
    until_s: float

    @staticmethod
    def none() -> CameraVelocity:
        """Return an unknown velocity: zero, and not valid at any time."""
        return CameraVelocity(np.zeros(2), np.zeros(4), -math.inf, -math.inf)

    def at(self, t: float) -> CameraVelocity:
        """Return what is known of it at a time (s)."""
        return self if t <= self.until_s else CameraVelocity.none()


def displacement(theta: FloatArray, centre: FloatArray, place: FloatArray) -> FloatArray:
    """Return how far points (N, 2) go by a motion (4,) about a centre (2,), or how fast by a rate (px/s)."""
    x, y = (place - centre).T
    return np.stack(
        [
            theta[0] + theta[2] * x - theta[3] * y,
            theta[1] + theta[2] * y + theta[3] * x,
        ],
        axis=1,
    )


def before_prediction(mean: FloatArray, camera: CameraVelocity) -> tuple[FloatArray, FloatArray]:
    """Take the camera's velocity out of states (N, 2, 7); return them, and how fast it took each (N, 2)."""
    moves = displacement(camera.rate, camera.centre, mean[:, :, POSITION])
    out = mean.copy()
    out[:, :, VELOCITY] -= moves
    return out, moves


def after_prediction(mean: FloatArray, moves: FloatArray, camera: CameraVelocity, dt: float) -> FloatArray:
    """Return states (N, 2, 7) that went by the camera's velocity, too, for `dt` (s)."""
    out = mean.copy()
    out[:, :, POSITION] += moves * dt
    out[:, :, VELOCITY] += displacement(camera.rate, camera.centre, out[:, :, POSITION])
    return out


def follow(
    mean: FloatArray,
    covariance: FloatArray,
    last_s: FloatArray,
    motion: PictureMotion,
    before: CameraVelocity,
    times: tuple[float, float],
) -> tuple[FloatArray, FloatArray, CameraVelocity]:
    """Compensate tracks for the camera's motion, as measured between its last two pictures.

    Args:
        mean: (N, 2, 7) states that are predicted to the picture.
        covariance: (N, 2, 7, 7).
        last_s: (N,) when each was detected last (s): until then it has been seen to go with the camera.
        motion: since the picture before.
        before: velocity that the tracks have been predicted with.
        times: of the tracks' last step, and of the picture (s).

    Returns:
        States, covariances, and the camera's velocity from now on.
    """
    step_s, t = times
    now = CameraVelocity(motion.centre, motion.theta / motion.span_s, t, t + _SPANS_KNOWN * motion.span_s)
    place = mean[:, :, POSITION]
    old = displacement(before.rate, before.centre, place)
    change = displacement(now.rate, now.centre, place) - old
    unseen = np.maximum(step_s - np.maximum(last_s, t - motion.span_s), 0.0)
    elapsed = t - step_s + unseen
    mean, covariance = mean.copy(), covariance.copy()
    mean[:, :, POSITION] += change * elapsed[:, None]
    mean[:, :, VELOCITY] += displacement(now.rate, now.centre, mean[:, :, POSITION]) - old
    grown = now.rate[2] - before.rate[2]
    mean[:, :, LOG_SIZE] += (grown * elapsed)[:, None]
    mean[:, :, GROWTH] += grown
    share = (elapsed / motion.span_s) ** 2
    x2, y2 = ((place - motion.centre) ** 2).T
    var_x, var_y, var_growth, var_rotation = motion.variance
    covariance[:, 0, POSITION, POSITION] += share * (var_x + var_growth * x2 + var_rotation * y2)
    covariance[:, 1, POSITION, POSITION] += share * (var_y + var_growth * y2 + var_rotation * x2)
    covariance[:, :, LOG_SIZE, LOG_SIZE] += (share * var_growth)[:, None]
    return mean, covariance, now


def with_velocity(mean: FloatArray, camera: CameraVelocity) -> FloatArray:
    """Return the states (N, 2, 7) of objects that begin, with the camera's velocity for their own."""
    out = mean.copy()
    out[:, :, VELOCITY] += displacement(camera.rate, camera.centre, mean[:, :, POSITION])
    out[:, :, GROWTH] += camera.rate[2]
    return out
