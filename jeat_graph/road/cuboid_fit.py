"""One vehicle's motion and size from its boxes: the cuboid that made them, over its whole track at once.

Length, width and height are the vehicle's own, shared by all its boxes; what kind it is (car, van, lorry ...)
is weighed by the evidence of each kind's sizes, and where that leaves a doubt, the doubt is in the result.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jeat_graph.config.fields import check, number
from jeat_graph.core import road as core
from jeat_graph.data.arrays import FloatArray
from jeat_graph.road.box_channels import CHANNELS
from jeat_graph.road.box_errors import BoxRows
from jeat_graph.road.box_rows import contact_places
from jeat_graph.road.box_solver import Motion, columns_of, solve_boxes
from jeat_graph.road.calibration_effect import calibration_effect, residual_slopes
from jeat_graph.road.camera import PARAMETERS, RoadCamera
from jeat_graph.road.fleet import CLASSES, MOST_BEYOND, beyond_vehicles
from jeat_graph.road.key_motion import RoadMotion
from jeat_graph.road.motion_fit import MotionFit, MotionFitConfig, basis_rows, motion_prior, spaced_knots

_LEAST_BOXES = 4
_DOUBT = 12.0  # minus twice the log of the odds below which a kind is ruled out
_SIZES = 3


@dataclass(frozen=True)
class CuboidConfig:
    """What is taken for a vehicle."""

    soft: float = number(3.0, "1", "residual / error at which a box's weight is a quarter", open_low=True)
    worst_chi2: float = number(
        6.0, "1", "mean square of residuals above which it is no vehicle", open_low=True
    )
    most_beyond: float = number(
        MOST_BEYOND,
        "1",
        "squared distance of a size beyond those of all kinds above which it is no vehicle",
        open_low=True,
    )
    scale_strength: float = number(
        40.0, "1", "observations' worth of belief in the stated errors", open_low=True
    )
    least_move_m: float = number(5.0, "m", "a vehicle that moves less faces along the road")
    least_speed: float = number(2.0, "m/s", "a vehicle slower than this faces as it does on the whole")

    def __post_init__(self) -> None:
        check(self)


class CuboidFit(NamedTuple):
    """What was found about one vehicle.

    Attributes:
        motion: of the middle of its footprint; covariance by noise alone.
        by_calibration: (2 C, 2 C) covariance of the motion's coefficients by the camera's.
        kind: index into `CLASSES` of the likeliest.
        size: (3,) length, width, height (m).
        size_covariance: (3, 3) of them.
        chi2: mean square of the residuals in their stated errors.
    """

    motion: RoadMotion
    by_calibration: FloatArray
    kind: int
    size: FloatArray
    size_covariance: FloatArray
    chi2: float


class Beginning(NamedTuple):
    """What a fit begins with.

    Attributes:
        rows: the boxes, from the first to the last that stands on the road.
        t0: time from which its own are counted (s).
        knots: (J,) times of jerks, so counted (s).
        basis: what a trial motion is made of.
        prior: (2 C, 2 C) precision of its coefficients.
        starts: coefficients (2 C,) to begin with, for each kind of vehicle.
    """

    rows: BoxRows
    t0: float
    knots: FloatArray
    basis: Motion
    prior: FloatArray
    starts: list[FloatArray]


class Candidate(NamedTuple):
    """A fit as one kind of vehicle.

    Attributes:
        kind: index into `CLASSES`.
        theta: (P,) coefficients of the motion, then length, width, height.
        covariance: (P, P) of them.
        cost: minus twice the logarithm of the evidence.
        chi2: mean square of the residuals in their stated errors.
        weight: (N,) robust weights of the boxes.
    """

    kind: int
    theta: FloatArray
    covariance: FloatArray
    cost: float
    chi2: float
    weight: FloatArray


def fit_cuboid(
    rows: BoxRows, camera: RoadCamera, config: CuboidConfig, motion: MotionFitConfig
) -> CuboidFit | None:
    """Fit one vehicle's boxes.

    Args:
        rows: the boxes (`box_rows`), in order of time.
        camera: the camera.
        config: what is taken for a vehicle.
        motion: how vehicles move.

    Returns:
        The fit, or None where too little of the vehicle is on the road, or no cuboid makes such boxes.
    """
    begun = begin(rows, camera, config, motion)
    return None if begun is None else fit_begun(begun, camera, config)


def fit_begun(begun: Beginning, camera: RoadCamera, config: CuboidConfig) -> CuboidFit | None:
    """Fit one vehicle's boxes from where `begin` begins.

    Args:
        begun: the boxes, and motions to begin with.
        camera: the camera.
        config: what is taken for a vehicle.

    Returns:
        The fit, or None where no cuboid makes such boxes.
    """
    compiled = camera.compiled()
    found = [one for k in range(len(CLASSES)) if (one := _fit_kind(compiled, begun, k, config)) is not None]
    mixed = mix(found, config)
    if mixed is None:
        return None
    best, theta, covariance = mixed
    rows, C = begun.rows, begun.basis.basis.shape[1]
    fit = MotionFit(
        *(begun.t0, begun.knots),
        *(theta[: 2 * C].reshape(2, C), covariance[: 2 * C, : 2 * C], np.zeros((2 * C, 0, 2))),
        *(rows.t, np.zeros((len(rows.t), 2)), best.weight),
    )
    return fit_of(fit, mixed, _calibration_effect(camera, rows, begun.basis, best), camera)


def fit_of(
    motion: RoadMotion,
    mixed: tuple[Candidate, FloatArray, FloatArray],
    effect: FloatArray,
    camera: RoadCamera,
) -> CuboidFit:
    """Put together what was found.

    Args:
        motion: the vehicle's.
        mixed: from `mix`.
        effect: (P, C) derivative of the motion's coefficients and the size with respect to the camera's.
        camera: the camera.
    """
    best, theta, covariance = mixed
    effect = effect[:-_SIZES]
    by_calibration = effect @ camera.covariance @ effect.T
    size = slice(-_SIZES, None)
    return CuboidFit(motion, by_calibration, best.kind, theta[size], covariance[size, size], best.chi2)


def begin(
    rows: BoxRows, camera: RoadCamera, config: CuboidConfig, motion: MotionFitConfig
) -> Beginning | None:
    """Find a motion to begin with, for each kind of vehicle; None where too little is on the road."""
    contact = contact_places(rows, camera)
    good = np.asarray(np.isfinite(contact).all(axis=1))
    if good.sum() < _LEAST_BOXES:
        return None
    t_good, contact = rows.t[good], contact[good]
    first, last = np.flatnonzero(good)[[0, -1]].tolist()
    rows = rows.take(slice(first, last + 1))
    if t_good[-1] <= t_good[0]:
        return None
    t0 = float(rows.t.mean())
    knots = spaced_knots(rows.t - t0, motion)
    prior = motion_prior(rows.t - t0, knots, motion)
    move = contact[-1] - contact[0]
    heading = math.atan2(move[0], move[1]) if np.linalg.norm(move) > config.least_move_m else 0.0
    basis = Motion(
        basis_rows(rows.t - t0, knots, 0), basis_rows(rows.t - t0, knots, 1), heading, config.least_speed
    )
    away = np.median(contact - camera.position[:2], axis=0)
    reach = abs(float(away @ [math.sin(heading), math.cos(heading)])) / float(np.linalg.norm(away)) ** 2
    B = basis_rows(t_good - t0, knots, 0)
    normal = np.kron(np.eye(2), B.T @ B) + prior
    starts: list[FloatArray] = []
    for one in CLASSES:
        # From the near end, which stands on the road where the box ends, to the middle.
        middle = contact + away * (one.mean[0] / 2.0 * reach)
        starts.append(np.asarray(np.linalg.solve(normal, (B.T @ middle).T.ravel()), dtype=np.float64))
    return Beginning(rows, t0, knots, basis, prior, starts)


def mix(found: list[Candidate], config: CuboidConfig) -> tuple[Candidate, FloatArray, FloatArray] | None:
    """Weigh the kinds by their evidence.

    Returns:
        The likeliest, and mean (P,) and covariance (P, P) of the mixture; None where no kind fits, or only
        in a size that no vehicle has.
    """
    if not found:
        return None
    best = min(found, key=lambda one: one.cost)
    if not best.chi2 <= config.worst_chi2:
        return None
    exact = np.zeros(_SIZES)
    if beyond_vehicles(best.theta[-_SIZES:], exact) > config.most_beyond:
        return None
    likely = [one for one in found if one.cost - best.cost < _DOUBT]
    share = np.exp(-0.5 * np.array([one.cost - best.cost for one in likely]))
    share /= share.sum()
    theta = np.einsum("k,kp->p", share, [one.theta for one in likely])
    # Errors that are larger than stated, by what is left over, are believed to be so.
    count = float(best.weight.sum()) * CHANNELS
    factor = (config.scale_strength + best.chi2 * count) / (config.scale_strength + count)
    covariance = np.zeros((len(theta), len(theta)))
    for weight, one in zip(share, likely, strict=True):
        off = one.theta - theta
        covariance += weight * (one.covariance * max(factor, 1.0) + np.outer(off, off))
    return best, theta, (covariance + covariance.T) / 2.0


def _fit_kind(camera: core.Camera, begun: Beginning, kind: int, config: CuboidConfig) -> Candidate | None:
    one, start = CLASSES[kind], np.concatenate([begun.starts[kind], CLASSES[kind].mean])
    P = len(start)
    precision = np.zeros((P, P))
    precision[: P - _SIZES, : P - _SIZES] = begun.prior
    precision[P - _SIZES :, P - _SIZES :] = np.diag(np.array(one.spread) ** -2.0)
    mean = np.concatenate([np.zeros(P - _SIZES), one.mean])
    C = (P - _SIZES) // 2
    mean[0], mean[C] = start[0], start[C]
    solved = solve_boxes(camera, begun.rows, begun.basis, start, (mean, precision), config.soft)
    if solved is None or not math.isfinite(solved.cost) or (solved.theta[P - _SIZES :] <= 0).any():
        return None
    theta, normal, cost, chi2, weight = solved
    sign, log_determinant = np.linalg.slogdet(normal)
    if sign <= 0:
        return None
    # The evidence: how well the data agree, less what it costs to have been able to agree with others.
    score = cost + float(log_determinant) + 2.0 * float(np.log(one.spread).sum()) - 2.0 * math.log(one.share)
    return Candidate(kind, theta, np.asarray(np.linalg.inv(normal), dtype=np.float64), score, chi2, weight)


def _calibration_effect(camera: RoadCamera, rows: BoxRows, motion: Motion, best: Candidate) -> FloatArray:
    """Derivative (P, 12) of the unknowns with respect to the camera's parameters."""
    P = len(best.theta)
    if not camera.covariance.any():
        return np.zeros((P, len(PARAMETERS)))
    here = columns_of(camera.compiled(), rows, motion, best.theta)
    if here is None:
        return np.zeros((P, len(PARAMETERS)))

    def residual(moved: core.Camera) -> FloatArray:
        found = columns_of(moved, rows, motion, best.theta)
        return (here if found is None else found)[..., P]

    return calibration_effect(
        here[..., :P], residual_slopes(camera, residual), rows, best.weight, best.covariance
    )
