"""Factors of a vehicle's states on the road about a trial of them: linear rows, as GTSAM takes them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.core import road as core
from jeat_graph.data.arrays import FloatArray
from jeat_graph.road.box_channels import CHANNELS, directions, linearise
from jeat_graph.road.box_errors import BoxRows, robust_weights
from jeat_graph.road.chain_rows import MOTION, SIZES, LinearBoxes, chain_rows
from jeat_graph.road.key_motion import key_rows
from jeat_graph.road.motion_fit import ANYWHERE_M, MotionFitConfig
from jeat_graph.smoothers.gtsam.shared_chain import ChainRows, PriorRows, SharedChain


class Drive(NamedTuple):
    """What does not change while a vehicle's states are sought.

    Attributes:
        camera: the camera.
        rows: the boxes.
        keys: (K,) times of the states (s).
        jerk: (2,) root spectral densities across and along the road (m/s^2.5).
        along: direction of a vehicle that hardly moves (rad).
        least_speed: a slower one hardly moves (m/s).
    """

    camera: core.Camera
    rows: BoxRows
    keys: FloatArray
    jerk: FloatArray
    along: float
    least_speed: float


class Trial(NamedTuple):
    """A motion and a size.

    Attributes:
        place: (N, 2) x, y (m) at the boxes.
        way: (N, 2) directions there, as `box_channels.directions` has them.
        size: (3,) length, width, height (m).
    """

    place: FloatArray
    way: FloatArray
    size: FloatArray


def trial_of(drive: Drive, place: FloatArray, velocity: FloatArray, size: FloatArray) -> Trial:
    """Make a trial of places (N, 2) and velocities (N, 2) at the boxes."""
    return Trial(place, directions(velocity, drive.along, drive.least_speed), size)


def trial_at(drive: Drive, coefficients: FloatArray, size: FloatArray) -> Trial:
    """Make a trial of the states at the keys, (2, 3 K) as `KeyMotion` has them."""
    place, rate = (key_rows(drive.rows.t, drive.keys, d) @ coefficients.T for d in range(2))
    return trial_of(drive, place, rate, size)


def residuals(camera: core.Camera, rows: BoxRows, trial: Trial) -> tuple[FloatArray, FloatArray] | None:
    """Derivatives (N, 4, 5) and residuals (N, 4) at a trial; None where it is not before the camera."""
    return linearise(camera, trial.place, trial.way, trial.size, rows.z, rows.mode)


def factors(
    drive: Drive, trial: Trial, weight: FloatArray, soft: float | None
) -> tuple[ChainRows, float] | None:
    """Factors between neighbouring states about a trial.

    Args:
        drive: the vehicle.
        trial: what to linearise at.
        weight: (N,) robust weights, renewed in place unless `soft` is None.
        soft: residual in standard deviations at which a box's weight is a quarter.

    Returns:
        The rows, and the logarithm of the determinant of their errors; None where the trial is not before the
        camera.
    """
    found = residuals(drive.camera, drive.rows, trial)
    if found is None:
        return None
    J, residual = found
    if soft is not None:
        weight[:] = robust_weights(residual, drive.rows, soft)
    d = residual + np.einsum("nci,ni->nc", J[..., :2], trial.place) + J[..., 2:] @ trial.size
    out, counts, logs = chain_rows(drive.keys, drive.rows, LinearBoxes(J, d, weight), drive.jerk)
    n = MOTION + CHANNELS * len(drive.rows.memory_s)
    A0, A1, B, b = np.split(out, [n, 2 * n, 2 * n + SIZES], axis=2)
    return ChainRows(A0, A1, B, b[..., 0], counts), float(logs.sum())


def first_state(config: MotionFitConfig, sensors: int, start: FloatArray) -> PriorRows:
    """What is believed of the first state: about where it is, `start` (2,), how vehicles move, errors."""
    along = np.array([ANYWHERE_M, config.speed_sd, config.acceleration_sd])
    across = along * np.array([1.0, config.lateral_factor, config.lateral_factor])
    A = np.diag(1.0 / np.concatenate([across, along, np.ones(CHANNELS * sensors)]))
    return PriorRows(0, A, A[:, [0, 3]] @ start)


def with_sensors(prior: PriorRows, more: int) -> PriorRows:
    """Add the errors of further sensors to what is known of a state: no box of theirs has shown them yet."""
    if prior.key is None:
        return prior
    (rows, states), errors = prior.A.shape, CHANNELS * more
    A = np.zeros((rows + errors, states + errors))
    A[:rows, :states], A[rows:, states:] = prior.A, np.eye(errors)
    b = np.concatenate([prior.b, np.zeros(errors)])
    B = None if prior.B is None else np.concatenate([prior.B, np.zeros((errors, prior.B.shape[1]))])
    return PriorRows(prior.key, A, b, B)


def jerk_of(config: MotionFitConfig) -> FloatArray:
    """Root spectral densities of jerk (2,) across and along the road (m/s^2.5)."""
    return np.asarray(config.jerk * np.array([config.lateral_factor, 1.0]))


def coefficients_of(solved: SharedChain) -> FloatArray:
    """Coefficients (2, 3 K) of a `KeyMotion`."""
    return np.asarray(solved.states[:, :MOTION].reshape(-1, 2, 3).swapaxes(0, 1).reshape(2, -1))
