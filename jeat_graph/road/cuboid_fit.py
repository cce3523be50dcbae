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
from jeat_graph.data.arrays import FloatArray
from jeat_graph.road.box_kernel import CHANNELS, HIGH, WHOLE, KernelCamera, kernel_camera
from jeat_graph.road.box_solver import BoxRows, Motion, linearise, solve_boxes, whiten
from jeat_graph.road.camera import PARAMETERS, RoadCamera
from jeat_graph.road.fleet import CLASSES
from jeat_graph.road.motion_fit import MotionFit, MotionFitConfig, basis_rows, motion_prior, spaced_knots

_LEAST_BOXES = 4
_CALIBRATION_STEP = 1e-3  # in standard deviations of each parameter, where it has one
_DOUBT = 12.0  # minus twice the log of the odds below which a kind is ruled out
_SIZES = 3


@dataclass(frozen=True)
class CuboidConfig:
    """What is taken for a vehicle."""

    soft: float = number(3.0, "1", "residual / error at which a box's weight is a quarter", open_low=True)
    worst_chi2: float = number(
        6.0, "1", "mean square of residuals above which it is no vehicle", open_low=True
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

    motion: MotionFit
    by_calibration: FloatArray
    kind: int
    size: FloatArray
    size_covariance: FloatArray
    chi2: float


class _Candidate(NamedTuple):
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
    contact = _contact(rows, camera)
    good = np.asarray(np.isfinite(contact).all(axis=1))
    if good.sum() < _LEAST_BOXES:
        return None
    t_good, contact = rows.t[good], contact[good]
    first, last = np.flatnonzero(good)[[0, -1]].tolist()
    rows = _from_to(rows, first, last)
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
    kernel = kernel_camera(camera)
    found: list[_Candidate] = []
    for k, one in enumerate(CLASSES):
        # From the near end, which stands on the road where the box ends, to the middle.
        middle = contact + away * (one.mean[0] / 2.0 * reach)
        c = np.linalg.solve(normal, (B.T @ middle).T.ravel())
        fit = _fit_kind(kernel, rows, basis, np.concatenate([c, one.mean]), prior, k, config)
        if fit is not None:
            found.append(fit)
    if not found:
        return None
    return _joined(found, rows, basis, camera, (t0, knots), config)


def _contact(rows: BoxRows, camera: RoadCamera) -> FloatArray:
    """Where the middles of the lower edges are on the road (N, 2); NaN where a side is cut off."""
    x, y = rows.mode.T
    bottom = rows.z[:, 1] + np.where(y == WHOLE, np.exp(rows.z[:, 3]) / 2.0, 0.0)
    place = camera.to_road(np.stack([rows.z[:, 0], bottom], axis=1))
    seen = (x == WHOLE) & ((y == WHOLE) | (y == HIGH))
    return np.where(seen[:, None], place, np.nan)


def _from_to(rows: BoxRows, first: int, last: int) -> BoxRows:
    part = slice(first, last + 1)
    cut = {
        name: np.ascontiguousarray(getattr(rows, name)[part])
        for name in rows._fields
        if name not in ("memory_s",)
    }
    return rows._replace(**cut)


def _fit_kind(
    camera: KernelCamera,
    rows: BoxRows,
    motion: Motion,
    start: FloatArray,
    motion_precision: FloatArray,
    kind: int,
    config: CuboidConfig,
) -> _Candidate | None:
    P, one = len(start), CLASSES[kind]
    precision = np.zeros((P, P))
    precision[: P - _SIZES, : P - _SIZES] = motion_precision
    precision[P - _SIZES :, P - _SIZES :] = np.diag(np.array(one.spread) ** -2.0)
    mean = np.concatenate([np.zeros(P - _SIZES), one.mean])
    C = (P - _SIZES) // 2
    mean[0], mean[C] = start[0], start[C]
    weight = np.ones(len(rows.t))
    settled, theta, normal, cost, chi2 = solve_boxes(
        camera, rows, motion, start, mean, precision, config.soft, weight
    )
    if not settled or not math.isfinite(cost) or (theta[P - _SIZES :] <= 0).any():
        return None
    sign, log_determinant = np.linalg.slogdet(normal)
    if sign <= 0:
        return None
    # The evidence: how well the data agree, less what it costs to have been able to agree with others.
    score = cost + float(log_determinant) + 2.0 * float(np.log(one.spread).sum()) - 2.0 * math.log(one.share)
    return _Candidate(kind, theta, np.asarray(np.linalg.inv(normal), dtype=np.float64), score, chi2, weight)


def _joined(
    found: list[_Candidate],
    rows: BoxRows,
    motion: Motion,
    camera: RoadCamera,
    times: tuple[float, FloatArray],
    config: CuboidConfig,
) -> CuboidFit | None:
    """Weigh the kinds by their evidence: mean and covariance of the mixture."""
    best = min(found, key=lambda one: one.cost)
    if not best.chi2 <= config.worst_chi2:
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
    covariance = (covariance + covariance.T) / 2.0
    t0, knots = times
    C = motion.basis.shape[1]
    fit = MotionFit(
        t0,
        knots,
        theta[: 2 * C].reshape(2, C),
        covariance[: 2 * C, : 2 * C],
        np.zeros((2 * C, 0, 2)),
        rows.t,
        np.zeros((len(rows.t), 2)),
        best.weight,
    )
    effect = _calibration_effect(camera, rows, motion, best)[: 2 * C]
    return CuboidFit(
        fit,
        effect @ camera.covariance @ effect.T,
        best.kind,
        theta[2 * C :],
        covariance[2 * C :, 2 * C :],
        best.chi2,
    )


def _calibration_effect(camera: RoadCamera, rows: BoxRows, motion: Motion, best: _Candidate) -> FloatArray:
    """Derivative (P, 12) of the unknowns with respect to the camera's parameters."""
    P, count = len(best.theta), len(PARAMETERS)
    effect = np.zeros((P, count))
    spread = np.sqrt(np.diag(camera.covariance))
    if not spread.any():
        return effect
    columns = np.zeros((len(rows.t), CHANNELS, P + 1 + count))
    trial = np.zeros((len(rows.t), CHANNELS, P + 1))
    linearise(kernel_camera(camera), rows, motion, best.theta, trial)
    columns[..., : P + 1] = trial
    for k in np.flatnonzero(spread > 0):
        slope = []
        for sign in (1.0, -1.0):
            change = np.zeros(count)
            change[k] = sign * _CALIBRATION_STEP * spread[k]
            linearise(kernel_camera(camera.moved(change)), rows, motion, best.theta, trial)
            slope.append(trial[..., P].copy())
        columns[..., P + 1 + k] = (slope[0] - slope[1]) / (2.0 * _CALIBRATION_STEP * spread[k])
    whiten(columns, rows, best.weight)
    flat = columns.reshape(-1, columns.shape[2])
    return np.asarray(best.covariance @ (flat[:, :P].T @ flat[:, P + 1 :]), dtype=np.float64)
