"""One vehicle's motion and size from its boxes: the cuboid that made them, over its whole track at once.

Length, width and height are the vehicle's own, shared by all its boxes; its kind (car, van, lorry ...) is
chosen by the evidence of each kind's sizes. Sides that the picture's edge cuts off do not count.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from jeat_graph.config.fields import check, number
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.interop import to_xyxy
from jeat_graph.road.camera import PARAMETERS, RoadCamera
from jeat_graph.road.cuboid import sides
from jeat_graph.road.motion_fit import MotionFit, MotionFitConfig, basis_rows, motion_prior, spaced_knots
from jeat_graph.road.robust import kernel


class VehicleClass(NamedTuple):
    """A kind of vehicle as fleets have it.

    Attributes:
        name: what it is called.
        share: of traffic.
        mean: length, width, height (m).
        spread: their standard deviations (m).
    """

    name: str
    share: float
    mean: tuple[float, float, float]
    spread: tuple[float, float, float]


#: Rough sizes of bodies without mirrors, wide enough that a vehicle of each kind lies within two deviations.
CLASSES = (
    VehicleClass("motorcycle", 0.01, (2.2, 0.8, 1.5), (0.2, 0.1, 0.15)),
    VehicleClass("car", 0.74, (4.4, 1.83, 1.55), (0.35, 0.08, 0.12)),
    VehicleClass("van", 0.12, (5.6, 2.0, 2.35), (0.6, 0.08, 0.3)),
    VehicleClass("truck", 0.07, (9.0, 2.5, 3.5), (1.8, 0.08, 0.4)),
    VehicleClass("truck", 0.06, (14.5, 2.52, 3.8), (2.2, 0.06, 0.3)),
)


@dataclass(frozen=True)
class CuboidConfig:
    """How boxes err."""

    side_px: float = number(0.7, "px", "error of a box's side that does not depend on size", open_low=True)
    side_share: float = number(0.015, "1", "error of a side as a share of the box's size")
    white_share: float = number(0.1, "1", "share of that variance which is new in every box", 0.0, 1.0)
    memory_s: float = number(1.0, "s", "how long the rest persists", open_low=True)
    node_s: float = number(0.1, "s", "boxes this close together in time are passed over", open_low=True)
    most_nodes: int = number(150, "boxes", "for longer tracks more are", 4)
    edge_px: float = number(2.0, "px", "a side this near the picture's edge is cut off by it")
    soft: float = number(3.0, "1", "residual / error at which a side's weight is a quarter", open_low=True)
    worst_chi2: float = number(
        9.0, "1", "mean square of residuals above which it is no vehicle", open_low=True
    )
    least_move_m: float = number(5.0, "m", "a vehicle that moves less faces along the road")

    def __post_init__(self) -> None:
        check(self)


class CuboidFit(NamedTuple):
    """What was found about one vehicle.

    Attributes:
        motion: of the middle of its footprint; covariance by noise alone.
        by_calibration: (2 C, 2 C) covariance of the motion's coefficients by the camera's.
        kind: index into `CLASSES`.
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


class _Task(NamedTuple):
    camera: RoadCamera
    config: CuboidConfig
    t: FloatArray
    seen: FloatArray
    usable: BoolArray
    sigma: FloatArray
    B: FloatArray
    heading: FloatArray


_STEPS = 12
_SETTLED = 1e-5
_CUT_OFF = 1e8
_CALIBRATION_STEP = 1e-3  # in standard deviations of each parameter, where it has one


def fit_cuboid(
    t: FloatArray,
    boxes: FloatArray,
    camera: RoadCamera,
    config: CuboidConfig,
    motion: MotionFitConfig,
    variance: FloatArray | None = None,
) -> CuboidFit | None:
    """Fit one vehicle's boxes.

    Args:
        t: (N,) times, ascending (s).
        boxes: (N, 4) left, top, width, height (px).
        camera: the camera.
        config: how boxes err.
        motion: how vehicles move.
        variance: (N, 2) of the boxes' middles as the tracker states them (px²), which are added.

    Returns:
        The fit, or None where too little of the vehicle is on the road, or no cuboid makes such boxes.
    """
    chosen = _choose(t, config)
    t, boxes = t[chosen], boxes[chosen]
    stated = np.zeros((len(t), 2)) if variance is None else variance[chosen]
    seen = to_xyxy(boxes)
    contact = camera.to_road(np.stack([boxes[:, 0] + boxes[:, 2] / 2.0, seen[:, 3]], axis=1))
    edge = config.edge_px
    usable = np.concatenate(
        [seen[:, :2] > edge, seen[:, 2:] < np.array([camera.width, camera.height]) - edge], axis=1
    )
    good = np.isfinite(contact).all(axis=1) & usable[:, 3]
    if good.sum() < 4 or t[good][-1] <= t[good][0]:
        return None
    t, seen, usable, contact, boxes = t[good], seen[good], usable[good], contact[good], boxes[good]
    stated = np.where(np.isfinite(stated[good]), stated[good], 0.0)
    move = contact[-1] - contact[0]
    away = np.median(contact - camera.position[:2], axis=0)
    away = away / np.linalg.norm(away)
    heading = math.atan2(move[0], move[1]) if np.linalg.norm(move) > config.least_move_m else 0.0
    s = t - t.mean()
    knots = spaced_knots(s, motion)
    B = basis_rows(s, knots, 0)
    sigma = np.hypot(config.side_px, config.side_share * np.tile(boxes[:, 2:], 2))
    sigma = np.sqrt(sigma**2 + np.tile(stated, 2))
    task = _Task(camera, config, t, seen, usable, sigma, B, np.full(len(t), heading))
    prior = motion_prior(s, knots, motion)
    best: tuple[float, int, tuple[FloatArray, FloatArray, FloatArray, FloatArray]] | None = None
    for k, one in enumerate(CLASSES):
        start = contact + away * one.mean[0] / 2.0 * abs(float(away @ [math.sin(heading), math.cos(heading)]))
        # Near a straight motion: the prior keeps accelerations and jerks small.
        C = B.shape[1]
        normal = np.kron(np.eye(2), B.T @ B) + prior
        c = np.linalg.solve(normal, (B.T @ start).T.ravel())
        found = _solve(task, np.concatenate([c, one.mean]), prior, one)
        if found is not None and (best is None or found[0] < best[0]):
            best = found[0], k, found[1:]
    if best is None:
        return None
    _, kind, (theta, inverse, gain, weight) = best
    C = B.shape[1]
    fit = MotionFit(
        float(t.mean()),
        knots,
        theta[: 2 * C].reshape(2, C),
        inverse[: 2 * C, : 2 * C],
        np.zeros((2 * C, len(t), 2)),
        t,
        np.zeros((len(t), 2)),
        weight,
    )
    effect = _calibration_effect(task, theta, gain)[: 2 * C]
    residual = (_predicted(task, camera, theta)[0] - seen) / sigma
    chi2 = float(np.median((residual[usable]) ** 2) / 0.4549)  # the median of a chi-square of one
    if not chi2 <= config.worst_chi2:
        return None
    return CuboidFit(
        fit,
        effect @ camera.covariance @ effect.T,
        kind,
        theta[2 * C :],
        inverse[2 * C :, 2 * C :],
        chi2,
    )


def _choose(t: FloatArray, config: CuboidConfig) -> IntArray:
    """Rows at least `node_s` apart, the last one among them."""
    step = max(config.node_s, float(t[-1] - t[0]) / config.most_nodes)
    cell = np.floor((t - t[0]) / step + 1e-9)
    return np.flatnonzero(np.r_[True, cell[1:] != cell[:-1]])


def _predicted(task: _Task, camera: RoadCamera, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
    C = task.B.shape[1]
    xy = task.B @ theta[: 2 * C].reshape(2, C).T
    return sides(camera, xy, task.heading, theta[2 * C :])


def _jacobian(task: _Task, J: FloatArray) -> FloatArray:
    """Derivative (4, N, P) of the sides with respect to all unknowns."""
    parts = [J[..., 0, None] * task.B[:, None], J[..., 1, None] * task.B[:, None], J[..., 2:]]
    return np.swapaxes(np.concatenate(parts, axis=-1), 0, 1)


def _solve(
    task: _Task, theta: FloatArray, motion_precision: FloatArray, kind: VehicleClass
) -> tuple[float, FloatArray, FloatArray, FloatArray, FloatArray] | None:
    """Gauss-Newton; returns minus the log evidence, the unknowns, their covariance, the gain, the weights."""
    config = task.config
    P = len(theta)
    precision = np.zeros((P, P))
    precision[: P - 3, : P - 3] = motion_precision
    precision[P - 3 :, P - 3 :] = np.diag(np.array(kind.spread) ** -2.0)
    C = task.B.shape[1]
    mean = np.concatenate([np.zeros(P - 3), kind.mean])
    mean[0], mean[C] = theta[0], theta[C]
    apart = np.abs(task.t[:, None] - task.t[None, :])
    shared = (1.0 - config.white_share) * np.exp(-apart / config.memory_s)
    weight = np.where(task.usable, 1.0, 0.0)
    cost = math.inf
    step = np.full(P, math.inf)
    for k in range(_STEPS):
        predicted, J = _predicted(task, task.camera, theta)
        if not np.isfinite(predicted).all():
            return None
        residual = (task.seen - predicted) / task.sigma
        if k > 1:
            weight = np.where(task.usable, kernel(np.abs(residual), config.soft), 0.0)
        H = _jacobian(task, J) / task.sigma.T[..., None]
        normal, right = precision.copy(), precision @ (mean - theta)
        gain = np.zeros((P, 4, len(task.t)))
        cost = float((theta - mean) @ precision @ (theta - mean))
        for side in range(4):
            extra = np.minimum(1.0 / np.maximum(weight[:, side], 1e-8), _CUT_OFF) - 1.0
            L = np.linalg.cholesky(shared + np.diag(config.white_share + extra))
            A = solve_triangular(L, H[side], lower=True)
            b = solve_triangular(L, residual[:, side], lower=True)
            normal += A.T @ A
            right += A.T @ b
            gain[:, side] = solve_triangular(L.T, A, lower=False).T / task.sigma[:, side]
            cost += float(b @ b) + 2.0 * float(np.log(np.diag(L)).sum())
        inverse = np.linalg.inv(normal)
        step = inverse @ right
        theta = theta + step
        if np.all(np.abs(step) <= _SETTLED * np.sqrt(np.diag(inverse)) + 1e-12) and k > 2:
            break
    if (theta[P - 3 :] <= 0).any():
        return None
    log_determinant = float(np.linalg.slogdet(normal)[1]) + 2.0 * float(np.log(kind.spread).sum())
    score = cost + log_determinant - 2.0 * math.log(kind.share)
    gain = np.einsum("ab,bsn->asn", inverse, gain)
    return score, theta, (inverse + inverse.T) / 2.0, gain, weight.mean(axis=1)


def _calibration_effect(task: _Task, theta: FloatArray, gain: FloatArray) -> FloatArray:
    """Derivative (P, 12) of the unknowns with respect to the camera's parameters."""
    effect = np.zeros((len(theta), len(PARAMETERS)))
    spread = np.sqrt(np.diag(task.camera.covariance))
    for k in np.flatnonzero(spread > 0):
        change = np.zeros(len(PARAMETERS))
        change[k] = _CALIBRATION_STEP * spread[k]
        ahead = _predicted(task, task.camera.moved(change), theta)[0]
        behind = _predicted(task, task.camera.moved(-change), theta)[0]
        slope = (ahead - behind) / (2.0 * change[k])
        # A camera that predicts a side farther right makes the vehicle seem farther left.
        effect[:, k] = -np.einsum("asn,ns->a", gain, slope)
    return effect
