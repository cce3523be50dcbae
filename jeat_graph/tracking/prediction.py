"""Where the tracks will be: the state now, predicted to a later time, which nobody has seen yet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.errors import TimeOrderError
from jeat_graph.data.scan import time_of
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.filters import box_sides, singer
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.smoothers.rows import ModelRows

_MOTION = [singer.POSITION, singer.VELOCITY, singer.ACCELERATION]


@dataclass(frozen=True, eq=False, repr=False)
class Prediction(Trajectories):
    """A table of predicted tracks, with the whole covariance of their motion.

    Attributes:
        cov: (N, 6, 6) covariance of `mean`, whose diagonal is `var`.
    """

    cov: FloatArray = ()  # type: ignore[assignment]


def time_from(t: Any, now: float | None) -> float:
    """Return a time to predict to (s).

    Args:
        t: what a user gave.
        now: time of the last step (s), or None before the first.

    Raises:
        DataError: a time that is not finite.
        TimeOrderError: a time before that of the last step.
    """
    t = time_of(t)
    if now is not None and t < now:
        raise TimeOrderError(f"t = {t} s is before the last scan at {now} s: that is past")
    return float(t)


def predicted(
    rows: ModelRows,
    states: tuple[FloatArray, FloatArray],
    t: float,
    noise: tuple[singer.ProcessNoise, float],
    c: ModelConstants,
) -> tuple[ModelRows, FloatArray]:
    """Predict rows of one time to another, by the filter's own model of motion.

    Args:
        rows: the tracks (N,) now.
        states: their means (N, 14) and covariances (N, 98).
        t: time (s), not before theirs.
        noise: process noise of the scene, and ln ρ² of its boxes.
        c: constants.

    Returns:
        The rows then, which no sensor has seen, and the covariances (N, 2, 5, 5) of
        `singer.reported_covariance`.
    """
    shape = (len(rows[0]), 2, singer.STATES)
    mean, covariance = states[0].reshape(shape), states[1].reshape(*shape, singer.STATES)
    dt = float(t - rows[0][0]) if len(rows[0]) else 0.0
    if dt > 0.0:
        model = singer.discretise(dt, c)
        F = singer.in_perspective(model.F, mean, dt, c)
        mean, covariance = singer.predict(mean, covariance, model, F, *noise, c)
    motion = singer.reported_covariance(mean, covariance, c)
    variance = np.diagonal(motion, axis1=2, axis2=3).reshape(-1, 2 * singer.MOTION)
    flat = singer.reported_motion(mean, c).reshape(-1, 2 * singer.MOTION)
    _, ids, _, _, real, used, label, share = rows
    return (np.full(len(mean), t), ids, flat, variance, real, 0 * used, label, share), motion


def still_there(rows: ModelRows, picture: tuple[float, float]) -> BoolArray:
    """Return which rows (N,) have a box that some part of the picture (px) shows."""
    boxes = box_sides.corners(rows[2].reshape(-1, 2, singer.MOTION))
    return np.asarray(((boxes[:, 2:] > 0.0) & (boxes[:, :2] < picture)).all(axis=1))


def of_motion(covariance: FloatArray) -> FloatArray:
    """Return the covariance (N, 6, 6) of position, velocity and acceleration, x and y in turn, as `mean` is.

    Args:
        covariance: (N, 2, 5, 5) of the states.
    """
    out = np.zeros((len(covariance), 6, 6))
    for axis in range(2):
        out[:, axis::2, axis::2] = covariance[:, axis][:, _MOTION][:, :, _MOTION]
    return out
