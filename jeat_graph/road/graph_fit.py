"""One vehicle's motion and size from its boxes as a factor graph, solved by GTSAM.

Variables are states at some times (place, speed, acceleration, and what persists of each sensor's errors) and
one size for all of them. Factors are white jerks between the states, the boxes that a cuboid of that size
makes in the picture, with each sensor's noise, and what is believed of sizes and motions before. `cuboid_fit`
puts the same belief into another form (a motion of few coefficients, its own solver).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jeat_graph.config.fields import check, number
from jeat_graph.data.arrays import FloatArray
from jeat_graph.road.box_kernel import CHANNELS, UNKNOWNS, KernelCamera, kernel_camera
from jeat_graph.road.box_solver import BoxRows, robust_weights, whiten
from jeat_graph.road.camera import PARAMETERS, RoadCamera
from jeat_graph.road.chain_rows import MOTION, SIZES, LinearBoxes, chain_rows, linearise_at
from jeat_graph.road.cuboid_fit import (
    Beginning,
    Candidate,
    CuboidConfig,
    CuboidFit,
    begin,
    calibration_effect,
    mix,
    residual_slopes,
)
from jeat_graph.road.fleet import CLASSES
from jeat_graph.road.key_motion import KeyMotion, key_rows
from jeat_graph.road.motion_fit import ANYWHERE_M, MotionFitConfig
from jeat_graph.smoothers.gtsam.shared_chain import ChainRows, PriorRows, SharedChain, solve_shared_chain

_STEPS = 14
_PLAIN_STEPS = 2
_SETTLED_M = 1e-3
_LEAST_SHARE = 0.3  # of a size before a step that may be left after it


@dataclass(frozen=True)
class GraphConfig:
    """Where the states of the graph are."""

    key_s: float = number(0.5, "s", "distance of the states", open_low=True)
    most_keys: int = number(60, "states", "of a longer track they are farther apart", 2)

    def __post_init__(self) -> None:
        check(self)


class _Trial(NamedTuple):
    """A motion and a size: x, y, heading (N, 3) at the boxes, and length, width, height."""

    place: FloatArray
    size: FloatArray


class _Graph(NamedTuple):
    """What does not change while a vehicle is fitted."""

    camera: KernelCamera
    begun: Beginning
    keys: FloatArray
    jerk: FloatArray
    motion: MotionFitConfig
    soft: float


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
    jerk = motion.jerk * np.array([motion.lateral_factor, 1.0])
    fixed = _Graph(kernel_camera(camera), begun, np.linspace(t[0], t[-1], count), jerk, motion, config.soft)
    found = [one for k in range(len(CLASSES)) if (one := _fit_kind(fixed, k)) is not None]
    mixed = mix(found, config)
    if mixed is None:
        return None
    best, theta, covariance = mixed
    C = 3 * count
    fit = KeyMotion(fixed.keys, theta[: 2 * C].reshape(2, C), covariance[: 2 * C, : 2 * C], t, best.weight)
    effect = _calibration_effect(camera, fixed, best)[: 2 * C]
    return CuboidFit(
        fit,
        effect @ camera.covariance @ effect.T,
        best.kind,
        theta[2 * C :],
        covariance[2 * C :, 2 * C :],
        best.chi2,
    )


def _fit_kind(graph: _Graph, kind: int) -> Candidate | None:
    """Gauss-Newton with robust weights, as one kind of vehicle."""
    begun, rows, one = graph.begun, graph.begun.rows, CLASSES[kind]
    C = begun.basis.basis.shape[1]
    ways = begun.starts[kind].reshape(2, C).T
    trial = _trial(graph, begun.basis.basis @ ways, begun.basis.rate @ ways, np.array(one.mean))
    priors = _priors(graph, trial.place[0, :2], kind)
    J, residual = np.zeros((len(rows.t), CHANNELS, UNKNOWNS)), np.zeros((len(rows.t), CHANNELS))
    weight = np.ones(len(rows.t))
    place_rows, speed_rows = (key_rows(rows.t, graph.keys, d) for d in range(2))
    for k in range(_STEPS):
        if not linearise_at(graph.camera, rows, trial.place, trial.size, J, residual):
            return None
        if k >= _PLAIN_STEPS:
            robust_weights(residual[..., None], rows, graph.soft, weight)
        d = residual + np.einsum("nci,ni->nc", J[..., :2], trial.place[:, :2]) + J[..., 2:] @ trial.size
        system, logs = _system(graph, LinearBoxes(J, d, weight))
        solved = solve_shared_chain(system, priors)
        # A size never changes its sign: halve a step that would.
        factor = 1.0
        while (trial.size + factor * (solved.shared - trial.size) < _LEAST_SHARE * trial.size).any():
            factor *= 0.5
        coefficients = _coefficients(solved)
        place, size = place_rows @ coefficients.T, solved.shared
        moved = max(np.abs(place - trial.place[:, :2]).max(), np.abs(size - trial.size).max())
        trial = _trial(
            graph,
            trial.place[:, :2] + factor * (place - trial.place[:, :2]),
            speed_rows @ coefficients.T,
            trial.size + factor * (size - trial.size),
        )
        if k > _PLAIN_STEPS and moved < _SETTLED_M and factor == 1.0:
            break
    if not np.isfinite(trial.place).all() or not linearise_at(
        graph.camera, rows, trial.place, trial.size, J, residual
    ):
        return None
    cost = _cost(system, priors, solved) + logs + solved.log_determinant
    cost += 2.0 * float(np.log(one.spread).sum()) - 2.0 * math.log(one.share)
    white = residual[..., None].copy()
    whiten(white, rows, weight)
    # Jerks are held by what is believed of them, and take next to nothing off the residuals.
    chi2 = float((white**2).sum()) / max(float(weight.sum()) * CHANNELS - MOTION - SIZES, 1.0)
    if not math.isfinite(cost):
        return None
    theta = np.concatenate([coefficients.ravel(), trial.size])
    index = _index(graph, solved)
    return Candidate(kind, theta, solved.covariance()[np.ix_(index, index)], cost, chi2, weight)


def _trial(graph: _Graph, place: FloatArray, velocity: FloatArray, size: FloatArray) -> _Trial:
    basis = graph.begun.basis
    moves = np.hypot(*velocity.T) > basis.least_speed
    heading = np.where(moves, np.arctan2(velocity[:, 0], velocity[:, 1]), basis.along)
    return _Trial(np.ascontiguousarray(np.c_[place, heading]), np.ascontiguousarray(size))


def _priors(graph: _Graph, start: FloatArray, kind: int) -> list[PriorRows]:
    """Beliefs: the motion and the errors in the beginning, the size of such vehicles."""
    config, one = graph.motion, CLASSES[kind]
    errors = CHANNELS * len(graph.begun.rows.memory_s)
    along = np.array([ANYWHERE_M, config.speed_sd, config.acceleration_sd])
    across = along * np.array([1.0, config.lateral_factor, config.lateral_factor])
    first = np.diag(1.0 / np.concatenate([across, along, np.ones(errors)]))
    spread = np.array(one.spread)
    return [
        PriorRows(0, first, first[:, [0, 3]] @ start),
        PriorRows(None, np.diag(1.0 / spread), np.array(one.mean) / spread),
    ]


def _system(graph: _Graph, boxes: LinearBoxes) -> tuple[ChainRows, float]:
    """Factors between neighbouring states about a trial, and the logarithm of their errors' determinant."""
    out, counts, logs = chain_rows(graph.keys, graph.begun.rows, boxes, graph.jerk)
    n = MOTION + CHANNELS * len(graph.begun.rows.memory_s)
    cuts = [n, 2 * n, 2 * n + SIZES]
    A0, A1, B, b = np.split(out, cuts, axis=2)
    return ChainRows(A0, A1, B, b[..., 0], counts), float(logs.sum())


def _coefficients(solved: SharedChain) -> FloatArray:
    """Coefficients (2, 3 K) of a `KeyMotion`."""
    return np.asarray(solved.states[:, :MOTION].reshape(-1, 2, 3).swapaxes(0, 1).reshape(2, -1))


def _index(graph: _Graph, solved: SharedChain) -> FloatArray:
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


def _calibration_effect(camera: RoadCamera, graph: _Graph, best: Candidate) -> FloatArray:
    """Derivative (P, 12) of the unknowns with respect to the camera's parameters."""
    P, rows = len(best.theta), graph.begun.rows
    if not camera.covariance.any():
        return np.zeros((P, len(PARAMETERS)))
    ways = best.theta[: P - SIZES].reshape(2, -1).T
    basis, rate = (key_rows(rows.t, graph.keys, d) for d in range(2))
    trial = _trial(graph, basis @ ways, rate @ ways, best.theta[P - SIZES :])
    J, residual = np.zeros((len(rows.t), CHANNELS, UNKNOWNS)), np.zeros((len(rows.t), CHANNELS))

    def residual_of(kernel: KernelCamera) -> FloatArray:
        linearise_at(kernel, rows, trial.place, trial.size, J, residual)
        return residual.copy()

    slopes = residual_slopes(camera, residual_of)
    linearise_at(graph.camera, rows, trial.place, trial.size, J, residual)
    of_ways = [J[..., axis, None] * basis[:, None] for axis in range(2)]
    return calibration_effect(np.concatenate([*of_ways, J[..., 2:]], axis=-1), slopes, rows, best)
