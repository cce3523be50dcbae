"""How likely it is that one piece of a track continues another: ln p(joined)/p(apart) in closed form.

A two-filter smoother (Fraser and Potter, *The optimum linear smoother as a combination of two optimum linear
filters*, AIAA Journal 7(8), 1969) over the motion model of `filters.singer`. The end of a piece is N(m, P) by
a forward filter; the beginning of another one is the likelihood exp(−½ xᵀ L x + eᵀ x + k) of the state x at
its first detection by a backward information filter. With m⁻, P⁻ predicted through the gap,

    ln p = k − ½ ln det(I + L P⁻) − ½ mᵀ L m + eᵀ m + ½ rᵀ P⁻ (I + L P⁻)⁻¹ r,   r = e − L m⁻.

Apart, the piece is born: flat in place and ln size, with the velocities of a birth. The difference of both
exponents, as a squared distance, is that of Student's t instead of the normal: as in association, errors have
heavy tails. Detections measure centre and ln size of each axis (linear), with the covariance that their sides
have: a side that the picture's edge cuts tells little, the other one as much as ever. Places are those that a
camera at rest would see: what the camera has moved until then is subtracted.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.filters import box_sides, singer
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.filters.singer import (
    LOG_SIZE,
    POSITION,
    POSITION_ERROR,
    SIZE_ERROR,
    STATES,
    ProcessNoise,
)

# What is measured of an axis: centre and ln size, each with the error that lasts.
_H = np.zeros((2, STATES))
_H[0, POSITION] = _H[0, POSITION_ERROR] = _H[1, LOG_SIZE] = _H[1, SIZE_ERROR] = 1.0
_EYE = np.eye(STATES)
# A flat prior is a normal one of so many pictures, and of so much ln size.
_FLAT_PICTURES, _FLAT_LOG_SIZE = 4.0, 4.0
# Numbers that the squared distance of a link has: both axes of place, velocity, size and its rate.
_FREEDOM = 8.0
_LOG_SIZE_BOUNDS = (-2.0, 12.0)
_MOST_DISTANCE = 400.0
# Steps are distinguished by this much (s); a gap of seconds is none the worse for it.
_STEP_S = 1e-4


class LearntScene(NamedTuple):
    """What was learnt of the recording.

    Attributes:
        noise: the process noise.
        log_side_variance: (S,) ln ρ² of each sensor's sides.
        log_scene_variance: the same of all, for the errors that last.
        picture: width and height (px).
        log_own_variance: (S,) ln of the part of it that a detector's own spread stands for; needed where
            detections have one.
    """

    noise: ProcessNoise
    log_side_variance: FloatArray
    log_scene_variance: float
    picture: tuple[float, float]
    log_own_variance: FloatArray | None = None


class MeasuredBoxes(NamedTuple):
    """Detections in order of time.

    Attributes:
        t: (N,) time (s).
        sensor: (N,) index.
        boxes: (N, 4) left, top, right, bottom (px).
        edges: (N, 2, 2) by axis and side, which end at the edge of the picture.
        camera: (N, 2) how far the camera's motion had taken what is at rest (px).
        spread: (N, 2, 2) f² σ² of the sides, where the detector says σ (`filters.box_spread`, px²), else NaN;
            or None.
    """

    t: FloatArray
    sensor: IntArray
    boxes: FloatArray
    edges: BoolArray
    camera: FloatArray
    spread: FloatArray | None = None


class PieceEnds(NamedTuple):
    """States (P, 2, 7) with covariances (P, 2, 7, 7) at the last detections of P pieces; their times (P,)."""

    t: FloatArray
    mean: FloatArray
    covariance: FloatArray


class PieceBeginnings(NamedTuple):
    """Likelihoods of the states at the first detections of P pieces.

    Attributes:
        t: (P,) time of it (s).
        mean: (P, 2, 7) centre and ln size of the first detection: what `e` refers to.
        birth: (P, 2, 7, 7) covariance of a birth there.
        L: (P, 2, 7, 7) information.
        e: (P, 2, 7) its vector, about `mean`.
        k: (P, 2) constants.
    """

    t: FloatArray
    mean: FloatArray
    birth: FloatArray
    L: FloatArray
    e: FloatArray
    k: FloatArray


class _Steps(NamedTuple):
    """Updates of a forward filter over at most K detections of P pieces, all of one step in one array."""

    rows: list[IntArray]
    hit: list[IntArray]
    R: list[FloatArray]
    mean: list[FloatArray]


def ends_of(seen: MeasuredBoxes, hits: IntArray, scene: LearntScene, c: ModelConstants) -> PieceEnds:
    """Filter each piece up to its last detection.

    Args:
        seen: all detections.
        hits: (P, K) the last detections of each piece in order of time, -1 before the first.
        scene: what was learnt.
        c: constants.
    """
    mean, covariance, _ = _filter(seen, hits, scene, c)
    return PieceEnds(seen.t[hits[:, -1]], mean, covariance)


def beginnings_of(
    seen: MeasuredBoxes, hits: IntArray, scene: LearntScene, c: ModelConstants
) -> PieceBeginnings:
    """Gather what each piece says of its state at its first detection.

    Args:
        seen: all detections.
        hits: (P, K) the first detections of each piece in order of time, -1 behind the last.
        scene: what was learnt.
        c: constants.
    """
    _, _, steps = _filter(seen, hits, scene, c)
    count, first = len(hits), hits[:, 0]
    mean, birth = _born(seen, first, scene, c)
    centre = np.zeros((count, 2, STATES))
    centre[..., POSITION], centre[..., LOG_SIZE] = mean[..., POSITION], mean[..., LOG_SIZE]
    L, e, k = np.zeros((count, 2, STATES, STATES)), np.zeros((count, 2, STATES)), np.zeros((count, 2))
    for step in range(len(steps.rows) - 1, -1, -1):
        rows, hit = steps.rows[step], steps.hit[step]
        if step + 1 < len(steps.rows):
            later = np.isin(rows, steps.rows[step + 1], assume_unique=True)
            on, now = rows[later], hit[later]
            after = hits[on, step + 1]
            F, Q = _transition(seen.t[after] - seen.t[now], steps.mean[step][later], scene, c)
            L[on], e[on], k[on] = _back(L[on], e[on], k[on], F, Q)
        z = _measure(seen, hit) - np.stack([centre[rows, :, POSITION], centre[rows, :, LOG_SIZE]], axis=-1)
        W = np.linalg.inv(steps.R[step])
        L[rows] += _H.T @ W @ _H
        Wz = (W @ z[..., None])[..., 0]
        e[rows] += Wz @ _H
        k[rows] -= (
            0.5 * (z * Wz).sum(axis=-1) + 0.5 * np.linalg.slogdet(steps.R[step])[1] + math.log(2.0 * math.pi)
        )
    return PieceBeginnings(seen.t[first], centre, birth, L, e, k)


def log_ratio(
    ends: PieceEnds,
    tail: IntArray,
    begun: PieceBeginnings,
    head: IntArray,
    scene: LearntScene,
    c: ModelConstants,
) -> FloatArray:
    """Return ln p(joined)/p(apart) (E,) of links; apart, the piece is born anywhere in the picture.

    Args:
        ends: of P pieces.
        tail: (E,) pieces that end.
        begun: of the same pieces.
        head: (E,) pieces that begin later.
        scene: what was learnt.
        c: constants.
    """
    born, constant = log_birth(begun, scene, c)
    out = np.zeros(len(tail))
    for at in range(0, len(tail), 20000):
        i, j = tail[at : at + 20000], head[at : at + 20000]
        mean, covariance = _predict(ends.mean[i], ends.covariance[i], begun.t[j] - ends.t[i], scene, c)
        centred = mean - begun.mean[j]
        exponent, rest = _joint(centred, covariance, begun.L[j], begun.e[j], begun.k[j])
        d2 = np.maximum(2.0 * (born[j] - exponent), 0.0)
        nu = c.degrees_of_freedom
        out[at : at + 20000] = rest - constant[j] - 0.5 * (nu + _FREEDOM) * np.log1p(d2 / nu)
    return out


def log_birth(begun: PieceBeginnings, scene: LearntScene, c: ModelConstants) -> tuple[FloatArray, FloatArray]:
    """Return exponents (P,) and constants (P,) of ln p of pieces that are born where they begin.

    The density is 1 / (W H) in place, and even over the area of sizes of `c.clutter_size_area`.
    """
    P = begun.birth.copy()
    P[..., POSITION, :] = P[..., :, POSITION] = P[..., LOG_SIZE, :] = P[..., :, LOG_SIZE] = 0.0
    P[..., POSITION, POSITION] = (_FLAT_PICTURES * np.asarray(scene.picture)) ** 2
    P[..., LOG_SIZE, LOG_SIZE] = _FLAT_LOG_SIZE**2
    exponent, constant = _joint(np.zeros_like(begun.mean), P, begun.L, begun.e, begun.k)
    # The normal's density at its middle stands for the even one.
    place = 2.0 * math.log(math.sqrt(2.0 * math.pi) * _FLAT_PICTURES)
    size = 2.0 * math.log(math.sqrt(2.0 * math.pi) * _FLAT_LOG_SIZE) - math.log(c.clutter_size_area)
    return exponent, constant + place + size


def _filter(
    seen: MeasuredBoxes, hits: IntArray, scene: LearntScene, c: ModelConstants
) -> tuple[FloatArray, FloatArray, _Steps]:
    """Filter pieces over their detections (P, K), -1 where there is none; states behind the last ones."""
    count = len(hits)
    mean, covariance = np.zeros((count, 2, STATES)), np.zeros((count, 2, STATES, STATES))
    begun, last = np.zeros(count, dtype=bool), np.zeros(count, dtype=np.int64)
    steps = _Steps([], [], [], [])
    for column in hits.T:
        rows = np.flatnonzero(column >= 0)
        hit = column[rows]
        new = ~begun[rows]
        fresh = rows[new]
        mean[fresh], covariance[fresh] = _born(seen, hit[new], scene, c)
        R = np.zeros((len(rows), 2, 2, 2))
        R[new] = _noise(seen, hit[new], _sizes(seen, hit[new]), scene, c)
        on = rows[~new]
        if len(on):
            m, P = _predict(mean[on], covariance[on], seen.t[hit[~new]] - seen.t[last[on]], scene, c)
            mean[on], covariance[on], R[~new] = _update(m, P, seen, hit[~new], scene, c)
        begun[rows], last[rows] = True, hit
        steps.rows.append(rows)
        steps.hit.append(hit)
        steps.R.append(R)
        steps.mean.append(mean[rows].copy())
    return mean, covariance, steps


def _update(
    m: FloatArray, P: FloatArray, seen: MeasuredBoxes, hit: IntArray, scene: LearntScene, c: ModelConstants
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return states and covariances after an update by detections, and the noise R (N, 2, 2, 2) it took."""
    expected = np.exp(np.clip(m[..., LOG_SIZE] + m[..., SIZE_ERROR], *_LOG_SIZE_BOUNDS))
    R = _noise(seen, hit, np.sqrt(expected * _sizes(seen, hit)), scene, c)
    y = _measure(seen, hit) - m @ _H.T
    PH = P @ _H.T
    S = _H @ PH + R
    d2 = (y[..., None, :] @ np.linalg.solve(S, y[..., None]))[..., 0, 0].sum(axis=1)
    R = R / box_sides.student_weight(np.minimum(d2, _MOST_DISTANCE), c)[:, None, None, None]
    K = np.linalg.solve(_H @ PH + R, PH.transpose(0, 1, 3, 2)).transpose(0, 1, 3, 2)
    P = P - K @ PH.transpose(0, 1, 3, 2)
    return m + (K @ y[..., None])[..., 0], (P + P.transpose(0, 1, 3, 2)) / 2.0, R


def _sizes(seen: MeasuredBoxes, hit: IntArray) -> FloatArray:
    """Return width and height (N, 2) of detections (px)."""
    return seen.boxes[hit, 2:] - seen.boxes[hit, :2]


def _measure(seen: MeasuredBoxes, hit: IntArray) -> FloatArray:
    """Return centre, as a camera at rest would see it, and ln size (N, 2, 2) of detections, by axis."""
    centre = (seen.boxes[hit, :2] + seen.boxes[hit, 2:]) / 2.0 - seen.camera[hit]
    return np.stack([centre, np.log(_sizes(seen, hit))], axis=-1)


def _noise(
    seen: MeasuredBoxes, hit: IntArray, size: FloatArray, scene: LearntScene, c: ModelConstants
) -> FloatArray:
    """Return the covariance (N, 2, 2, 2) of centre and ln size by axis, of sides that err independently."""
    both = np.sqrt(size.prod(axis=1))[:, None]
    rho2 = np.exp(scene.log_side_variance[seen.sensor[hit]])[:, None]
    side = (rho2 * (0.5 * both + 0.5 * size) ** 2 + c.pixel_std**2)[..., None]
    if seen.spread is not None and scene.log_own_variance is not None:
        own = np.exp(scene.log_own_variance[seen.sensor[hit]])[:, None] * (0.5 * both + 0.5 * size) ** 2
        given = seen.spread[hit]
        side = np.where(np.isnan(given), side, side + given - own[..., None])
    low, high = np.moveaxis(side + box_sides.cut_variance(seen.edges[hit], size, c), -1, 0)
    R = np.empty((len(hit), 2, 2, 2))
    R[..., 0, 0], R[..., 1, 1] = (low + high) / 4.0, (low + high) / size**2
    R[..., 0, 1] = R[..., 1, 0] = (high - low) / (2.0 * size)
    return R


def _born(
    seen: MeasuredBoxes, hit: IntArray, scene: LearntScene, c: ModelConstants
) -> tuple[FloatArray, FloatArray]:
    """Return states and covariances of pieces that begin at detections."""
    boxes, size = seen.boxes[hit], _sizes(seen, hit)
    mean, P = box_sides.initial_state(
        boxes, np.zeros((len(hit), 2, 2), bool), 0.0, scene.log_scene_variance, c
    )
    mean[..., POSITION] -= seen.camera[hit]
    R = _noise(seen, hit, size, scene, c)
    # What lasts of the error is in the box, too.
    for a, state, lasting in ((0, POSITION, POSITION_ERROR), (1, LOG_SIZE, SIZE_ERROR)):
        P[..., state, state] = R[..., a, a] + P[..., lasting, lasting]
        P[..., state, lasting] = P[..., lasting, state] = -P[..., lasting, lasting]
    P[..., POSITION, LOG_SIZE] = P[..., LOG_SIZE, POSITION] = R[..., 0, 1]
    return mean, P


def _predict(
    mean: FloatArray, covariance: FloatArray, dt: FloatArray, scene: LearntScene, c: ModelConstants
) -> tuple[FloatArray, FloatArray]:
    """Predict states over times of their own (N,), as `singer.predict` does."""
    out, P = np.empty_like(mean), np.empty_like(covariance)
    ticks = np.rint(dt / _STEP_S).astype(np.int64)
    for tick in np.unique(ticks):
        rows, s = np.flatnonzero(ticks == tick), float(tick) * _STEP_S
        step = singer.discretise(s, c)
        F = singer.in_perspective(step.F, mean[rows], s, c)
        out[rows], P[rows] = singer.predict(
            mean[rows], covariance[rows], step, F, scene.noise, scene.log_scene_variance, c
        )
    return out, P


def _transition(
    dt: FloatArray, mean: FloatArray, scene: LearntScene, c: ModelConstants
) -> tuple[FloatArray, FloatArray]:
    """Return F (N, 1, 7, 7) and Q (N, 2, 7, 7) from states (N, 2, 7) over times of their own (N,)."""
    F, Q = np.empty((len(dt), 1, STATES, STATES)), np.empty((len(dt), 2, STATES, STATES))
    ticks = np.rint(dt / _STEP_S).astype(np.int64)
    for tick in np.unique(ticks):
        rows, s = np.flatnonzero(ticks == tick), float(tick) * _STEP_S
        step = singer.discretise(s, c)
        F[rows] = singer.in_perspective(step.F, mean[rows], s, c)
        nothing = np.zeros((len(rows), 2, STATES, STATES))
        noise = scene.noise, scene.log_scene_variance
        Q[rows] = singer.predict(mean[rows], nothing, step, F[rows], *noise, c)[1]
    return F, Q


def _back(
    L: FloatArray, e: FloatArray, k: FloatArray, F: FloatArray, Q: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a likelihood of later states as one of the states before the step x' = F x + w, w ~ N(0, Q)."""
    A = _EYE + L @ Q
    M = np.linalg.inv(A)
    Ft = F.transpose(0, 1, 3, 2)
    ML = M @ L
    Me = (M @ e[..., None])[..., 0]
    more = 0.5 * (e[..., None, :] @ Q @ Me[..., None])[..., 0, 0] - 0.5 * np.linalg.slogdet(A)[1]
    back = Ft @ ((ML + ML.transpose(0, 1, 3, 2)) / 2.0) @ F
    return back, (Ft @ Me[..., None])[..., 0], k + more


def _joint(
    m: FloatArray, P: FloatArray, L: FloatArray, e: FloatArray, k: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return exponent (N,) and constant (N,) of ln ∫ N(x; m, P) exp(−½ xᵀ L x + eᵀ x + k) dx of both axes."""
    A = _EYE + L @ P
    r = e - (L @ m[..., None])[..., 0]
    u = np.linalg.solve(A, r[..., None])
    exponent = -0.5 * (m[..., None, :] @ L @ m[..., None])[..., 0, 0] + (e * m).sum(axis=-1)
    exponent = exponent + 0.5 * (r[..., None, :] @ P @ u)[..., 0, 0]
    return exponent.sum(axis=-1), (k - 0.5 * np.linalg.slogdet(A)[1]).sum(axis=-1)
