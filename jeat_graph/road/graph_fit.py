"""One vehicle's motion and size from its boxes as a factor graph, solved by GTSAM.

Variables are states at some times (place, speed, acceleration, and what persists of each sensor's errors) and
one size for all of them. Factors are white jerks between the states, the boxes that a cuboid of that size
makes in the picture, with each sensor's noise, and what is believed of sizes and motions before. `cuboid_fit`
puts the same belief into another form (a motion of few coefficients, its own solver).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from jeat_graph.config.fields import check, number
from jeat_graph.core import road as core
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.road.box_channels import CHANNELS
from jeat_graph.road.box_errors import BoxRows, whiten
from jeat_graph.road.box_solver import by_coefficients, size_step
from jeat_graph.road.calibration_effect import calibration_effect, residual_slopes
from jeat_graph.road.camera import PARAMETERS, RoadCamera
from jeat_graph.road.chain_rows import MOTION, SIZES
from jeat_graph.road.cuboid_fit import (
    Beginning,
    Candidate,
    CuboidConfig,
    CuboidFit,
    begin,
    fit_of,
    mix,
)
from jeat_graph.road.fleet import CLASSES
from jeat_graph.road.key_motion import KeyMotion, key_rows
from jeat_graph.road.motion_fit import MotionFitConfig
from jeat_graph.road.road_factors import (
    Drive,
    coefficients_of,
    factors,
    first_state,
    jerk_of,
    residuals,
    trial_at,
    trial_of,
)
from jeat_graph.smoothers.gtsam.shared_chain import ChainRows, PriorRows, SharedChain, solve_shared_chain

_STEPS = 14
_PLAIN_STEPS = 2
_SETTLED_M = 1e-3


@dataclass(frozen=True)
class GraphConfig:
    """Where the states of the graph are."""

    key_s: float = number(0.5, "s", "distance of the states", open_low=True)
    most_keys: int = number(60, "states", "of a longer track they are farther apart", 2)

    def __post_init__(self) -> None:
        check(self)


def fit_graph(
    rows: BoxRows,
    camera: RoadCamera,
    config: CuboidConfig,
    motion: MotionFitConfig,
    graph: GraphConfig = GraphConfig(),
) -> CuboidFit | None:
    """Fit one vehicle's boxes.

    Args:
        rows: the boxes (`box_rows`), in order of time.
        camera: the camera.
        config: what is taken for a vehicle.
        motion: how vehicles move.
        graph: where the states are.

    Returns:
        The fit, or None where too little of the vehicle is on the road, or no cuboid makes such boxes.

    Raises:
        RuntimeError: GTSAM's, where the factors leave something undetermined.
    """
    begun = begin(rows, camera, config, motion)
    if begun is None:
        return None
    t = begun.rows.t
    count = int(min(max(math.ceil((t[-1] - t[0]) / graph.key_s), 1) + 1, graph.most_keys))
    drive = Drive(
        camera.compiled(),
        begun.rows,
        np.linspace(t[0], t[-1], count),
        jerk_of(motion),
        begun.basis.along,
        begun.basis.least_speed,
    )
    found = [
        one
        for k in range(len(CLASSES))
        if (one := _fit_kind(drive, begun, motion, config.soft, k)) is not None
    ]
    mixed = mix(found, config)
    if mixed is None:
        return None
    best, theta, covariance = mixed
    C = 3 * count
    fit = KeyMotion(drive.keys, theta[: 2 * C].reshape(2, C), covariance[: 2 * C, : 2 * C], t, best.weight)
    return fit_of(fit, mixed, _calibration_effect(camera, drive, best), camera)


def _fit_kind(
    drive: Drive, begun: Beginning, motion: MotionFitConfig, soft: float, kind: int
) -> Candidate | None:
    """Gauss-Newton with robust weights, as one kind of vehicle."""
    rows, one = drive.rows, CLASSES[kind]
    ways = begun.starts[kind].reshape(2, -1).T
    trial = trial_of(drive, begun.basis.basis @ ways, begun.basis.rate @ ways, np.array(one.mean))
    spread = np.array(one.spread)
    priors = [
        first_state(motion, len(rows.memory_s), trial.place[0]),
        PriorRows(None, np.diag(1.0 / spread), np.array(one.mean) / spread),
    ]
    weight = np.ones(len(rows.t))
    step = None
    for k in range(_STEPS):
        linear = factors(drive, trial, weight, soft if k >= _PLAIN_STEPS else None)
        if linear is None:
            return None
        solved = solve_shared_chain(linear[0], priors)
        factor = size_step(trial.size, solved.shared)
        coefficients = coefficients_of(solved)
        target = trial_at(drive, coefficients, solved.shared)
        off, more = target.place - trial.place, target.size - trial.size
        if factor < 1.0:
            target = target._replace(place=trial.place + factor * off, size=trial.size + factor * more)
        trial, step = target, (*linear, solved, coefficients)
        if k > _PLAIN_STEPS and max(np.abs(off).max(), np.abs(more).max()) < _SETTLED_M:
            break
    found = residuals(drive.camera, rows, trial) if np.isfinite(trial.place).all() else None
    if step is None or found is None:
        return None
    system, log_errors, solved, coefficients = step
    cost = _cost(system, priors, solved) + log_errors + solved.log_determinant
    cost += 2.0 * float(np.log(one.spread).sum()) - 2.0 * math.log(one.share)
    white = found[1][..., None].copy()
    whiten(white, rows, weight)
    # Jerks are held by what is believed of them, and take next to nothing off the residuals.
    chi2 = float((white**2).sum()) / max(float(weight.sum()) * CHANNELS - MOTION - SIZES, 1.0)
    if not math.isfinite(cost):
        return None
    theta, index = np.concatenate([coefficients.ravel(), trial.size]), _index(solved)
    return Candidate(kind, theta, solved.covariance()[np.ix_(index, index)], cost, chi2, weight)


def _index(solved: SharedChain) -> IntArray:
    """Places of the coefficients and the size among all unknowns."""
    K, n = solved.states.shape
    each = np.arange(K)[:, None] * n
    return np.concatenate(
        [(each + np.arange(3)).ravel(), (each + np.arange(3, 6)).ravel(), K * n + np.arange(SIZES)]
    )


def _cost(system: ChainRows, priors: list[PriorRows], solved: SharedChain) -> float:
    """Sum of squares of all rows at the solution."""
    x, s = solved.states, solved.shared
    left = np.einsum("srn,sn->sr", system.A0, x[:-1]) + np.einsum("srn,sn->sr", system.A1, x[1:])
    total = float(((left + system.B @ s - system.b) ** 2).sum())
    for prior in priors:
        total += float(((prior.A @ (s if prior.key is None else x[prior.key]) - prior.b) ** 2).sum())
    return total


def _calibration_effect(camera: RoadCamera, drive: Drive, best: Candidate) -> FloatArray:
    """Derivative (P, 12) of the unknowns with respect to the camera's parameters."""
    P, rows = len(best.theta), drive.rows
    trial = trial_at(drive, best.theta[: P - SIZES].reshape(2, -1), best.theta[P - SIZES :])
    here = residuals(drive.camera, rows, trial)
    if here is None or not camera.covariance.any():
        return np.zeros((P, len(PARAMETERS)))

    def residual_of(moved: core.Camera) -> FloatArray:
        found = residuals(moved, rows, trial)
        return here[1] if found is None else found[1]

    basis = key_rows(rows.t, drive.keys, 0)
    columns = by_coefficients(*here, basis)[..., :P]
    return calibration_effect(
        columns, residual_slopes(camera, residual_of), rows, best.weight, best.covariance
    )
