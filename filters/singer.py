"""Singer's motion model of the box centre, and of the logarithm of its size, one axis at a time.

State of one axis: [p, v, a, l, r, b, c]: position (px), velocity (px/s), acceleration (px/s²), ln size, its
rate (1/s), and what lasts of the detectors' errors of position (px) and of ln size: boxes measure p + b and
l + c.

    dp = v dt + σ_p dβ₁,   dv = (a − v/τ_v) dt,   da = −a/τ_a dt + σ_j dβ₂,
    dl = r dt + σ_l dβ₃,   dr = −r/τ_r dt + σ_r dβ₄
    db = −b/τ_e dt + σ_b √(2/τ_e) dβ₅,   dc = −c/τ_e dt + σ_c √(2/τ_e) dβ₆

(Singer, *Estimating optimal tracking filter performance for manned maneuvering targets*, 1970; Särkkä and
Solin, *Applied Stochastic Differential Equations*, ch. 6). The random walks of position and size stand for
what a detector's boxes do that lasts and is no motion. For τ → ∞ and σ_p = 0 the first three are the paper's
constant acceleration driven by white jerk (eq. 2). On top of that a point that moves at constant velocity in
space has the image x = X/Z, so with g = −Ż/Z, the growth rate of its size, ẍ = 2 g ẋ and ġ = g²: see
`in_perspective`. The errors are first-order Gauss–Markov processes (Bryson and Johansen, "Linear filtering
for time-varying systems using measurements containing colored noise", IEEE T-AC 10(1), 1965) with the
variances of `lasting_error`. Arrays hold all tracks: mean (N, 2, 7), covariance (N, 2, 7, 7); the axes are
independent.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.model_constants import ModelConstants

#: Places in the state of one axis, and its length.
POSITION, VELOCITY, ACCELERATION, LOG_SIZE, GROWTH, POSITION_ERROR, SIZE_ERROR, STATES = range(8)
#: Those of the motion stand before those of the errors.
MOTION = POSITION_ERROR
# Van Loan's exponential has terms e^(Δ/τ), which overflow for long steps: these are made by doubling.
_LONGEST_STEP_S = 1.0
# Steps are taken in whole microseconds: what follows depends on time differences, not on the clock's origin.
_TICKS_PER_S = 1e6
# Less growth in one step has no effect.
_LEAST_PERSPECTIVE = 1e-6
# Image coordinates go as 1/Z: p⃛ = 6 p (Ż/Z)³, and half of a power less is what a root spectral density has.
_PERSPECTIVE_POWER = 2.5


class ProcessNoise(NamedTuple):
    """Natural logarithms of the spectral densities (squares of the root densities) of the four noises.

    Attributes:
        jerk: of the acceleration (sizes²/s⁵).
        growth: of the rate of ln size (1/s³).
        position: of the position's random walk (sizes²/s).
        size: of the random walk of ln size (1/s).
    """

    jerk: float
    growth: float
    position: float
    size: float


class Discretised(NamedTuple):
    """The model over one step: transition, and the covariance by each noise of unit density, (7, 7) each."""

    F: FloatArray
    jerk: FloatArray
    growth: FloatArray
    position: FloatArray
    size: FloatArray


def initial_process_noise(c: ModelConstants) -> ProcessNoise:
    """Return the process noise before anything is learnt."""
    return ProcessNoise(*(2.0 * math.log(s) for s in (c.jerk, c.growth_noise, c.position_walk, c.size_walk)))


def whole_microseconds(dt: float) -> float:
    """Return a length of time (s) to the microsecond."""
    return round(dt * _TICKS_PER_S) / _TICKS_PER_S


def discretise(dt: float, c: ModelConstants) -> Discretised:
    """Return the model over `dt` seconds (>= 0), to the microsecond."""
    return _discretised(round(dt * _TICKS_PER_S), c)


@lru_cache(maxsize=2048)
def _discretised(ticks: int, c: ModelConstants) -> Discretised:
    """Matrix exponential and Van Loan's integrals (IEEE Trans. Automatic Control 23, 1978).

    exp([[−A, L], [0, Aᵀ]] Δ) = [[·, F⁻¹ Q], [0, Fᵀ]]; a long step is made of equal halves: Q(2Δ) = Q + F Q
    Fᵀ.
    """
    dt = ticks / _TICKS_PER_S
    doublings = max(0, math.ceil(math.log2(dt / _LONGEST_STEP_S))) if dt > 0.0 else 0
    short = dt / 2**doublings
    A = drift(c)
    F = np.asarray(expm(A * short))
    noises = []
    for driven in (ACCELERATION, GROWTH, POSITION, LOG_SIZE):
        block = np.zeros((2 * STATES, 2 * STATES))
        block[:STATES, :STATES], block[STATES:, STATES:] = -A, A.T
        block[driven, STATES + driven] = 1.0
        noises.append(F @ np.asarray(expm(block * short))[:STATES, STATES:])
    for _ in range(doublings):
        noises = [Q + F @ Q @ F.T for Q in noises]
        F = F @ F
    return Discretised(F, *noises)


def drift(c: ModelConstants) -> FloatArray:
    """Return the drift matrix A (7, 7) of dx = A x dt + noise."""
    A = np.zeros((STATES, STATES))
    A[POSITION, VELOCITY] = A[VELOCITY, ACCELERATION] = A[LOG_SIZE, GROWTH] = 1.0
    A[VELOCITY, VELOCITY] = -1.0 / c.velocity_time_s
    A[ACCELERATION, ACCELERATION] = -1.0 / c.acceleration_time_s
    A[GROWTH, GROWTH] = -1.0 / c.growth_time_s
    A[POSITION_ERROR, POSITION_ERROR] = A[SIZE_ERROR, SIZE_ERROR] = -1.0 / c.error_time_s
    return A


def process_covariance(
    size: FloatArray, growth: FloatArray, step: Discretised, q: ProcessNoise, c: ModelConstants
) -> FloatArray:
    """Return the covariance Q (N, 1, 7, 7) that a step adds to the motion; both axes have the same.

    Q = s² (σ_j + k g^2.5)² Q_j + σ_r² Q_r + s² σ_p² Q_p + σ_l² Q_l.

    Args:
        size: (N,) size s (px) before the step.
        growth: (N,) growth rate g (1/s) after it, >= 0.
        step: the model over that time.
        q: densities of the process noise.
        c: constants.
    """
    jerk = (
        math.exp(q.jerk / 2.0)
        + c.perspective_jerk * np.minimum(growth, c.fastest_growth) ** _PERSPECTIVE_POWER
    )
    s_jerk, s_walk = (jerk * size) ** 2, math.exp(q.position) * size**2
    same = math.exp(q.growth) * step.growth + math.exp(q.size) * step.size
    out = s_jerk[:, None, None] * step.jerk + same + s_walk[:, None, None] * step.position
    return np.asarray(out[:, None])


def in_perspective(F: FloatArray, mean: FloatArray, dt: float, c: ModelConstants) -> FloatArray:
    """Return the transitions (N, 1, 7, 7) of tracks that keep their velocity in space, for both axes.

    With g the mean growth rate of both axes, v̇ = 2 g v and ġ = g² have the solutions v e^(2 g Δ) and
    g / (1 − g Δ); position and ln size follow by their integrals. g counts as known.

    Args:
        F: (7, 7) transition of a track that does not grow.
        mean: (N, 2, 7) states before the step.
        dt: length of the step (s).
        c: constants.
    """
    x = np.clip(mean[:, :, GROWTH].mean(axis=1) * dt, -c.most_perspective, c.most_perspective)
    x = np.where(np.abs(x) < _LEAST_PERSPECTIVE, 0.0, x)
    divisor = np.where(x == 0.0, 1.0, x)
    out = np.repeat(F[None, None], len(mean), axis=0)
    out[:, 0, POSITION, VELOCITY] *= np.where(x == 0.0, 1.0, (np.exp(2.0 * x) - 1.0) / (2.0 * divisor))
    out[:, 0, VELOCITY, VELOCITY] *= np.exp(2.0 * x)
    out[:, 0, LOG_SIZE, GROWTH] *= np.where(x == 0.0, 1.0, -np.log(1.0 - x) / divisor)
    out[:, 0, GROWTH, GROWTH] *= 1.0 / (1.0 - x)
    return out


def reported_motion(mean: FloatArray, c: ModelConstants) -> FloatArray:
    """Return what tables tell of states (..., 2, 7): the motion (..., 2, 5) of the box as detectors have it.

    What lasts of the detectors' errors is in place and size: smoothed, a box without that follows the model's
    errors instead of its own (position's RMSE 3.1 px and with it 2.1 px on simulated roads). The
    acceleration is that of the centre in the picture, dv/dt = a + (2 g − 1/τ_v) v with g the mean growth
    rate of both axes: a alone is what neither perspective nor damping explains. A camera's measured velocity
    counts as the track's own here.
    """
    out = mean[..., :MOTION].copy()
    out[..., POSITION] += mean[..., POSITION_ERROR]
    out[..., LOG_SIZE] += mean[..., SIZE_ERROR]
    out[..., ACCELERATION] += _acceleration_by_velocity(mean, c) * mean[..., VELOCITY]
    return out


def reported_covariance(mean: FloatArray, covariance: FloatArray, c: ModelConstants) -> FloatArray:
    """Return the covariance (..., 2, 5, 5) of what `reported_motion` tells.

    J P Jᵀ with the derivatives of the acceleration, 2 g − 1/τ_v by v, 1 by a and v by r, plus v² Var(r) of
    the other axis, from which half of g comes. Place and size vary as those of the object do.

    Args:
        mean: (..., 2, 7) states.
        covariance: (..., 2, 7, 7).
        c: constants.
    """
    out = covariance[..., :MOTION, :MOTION].copy()
    v = mean[..., VELOCITY, None]
    by_velocity = _acceleration_by_velocity(mean, c)[..., None]
    row = out[..., ACCELERATION, :] + by_velocity * out[..., VELOCITY, :] + v * out[..., GROWTH, :]
    own = row[..., ACCELERATION] + by_velocity[..., 0] * row[..., VELOCITY] + v[..., 0] * row[..., GROWTH]
    out[..., ACCELERATION, :] = out[..., :, ACCELERATION] = row
    out[..., ACCELERATION, ACCELERATION] = own + v[..., 0] ** 2 * covariance[..., ::-1, GROWTH, GROWTH]
    return out


def _acceleration_by_velocity(mean: FloatArray, c: ModelConstants) -> FloatArray:
    """Return ∂v̇/∂v = 2 g − 1/τ_v (..., 1) of states (..., 2, 7)."""
    return np.asarray(2.0 * mean[..., GROWTH].mean(axis=-1, keepdims=True) - 1.0 / c.velocity_time_s)


def lasting_error(size: FloatArray, log_variance: float, c: ModelConstants) -> tuple[FloatArray, FloatArray]:
    """Return the stationary variances (N, 2) by axis of b (px²) and of c.

    Both sides err independently, with the variance κ ρ² (½ √(w h) + ½ w)²: the centre with half of it, ln
    size with 2/w² of it. κ is the ratio of what lasts to what is new in every scan.

    Args:
        size: (N, 2) width and height (px).
        log_variance: ln ρ² of the sides.
        c: constants.
    """
    both = np.sqrt(size.prod(axis=1))[:, None]
    side = c.error_share * math.exp(log_variance) * (0.5 * both + 0.5 * size) ** 2
    return side / 2.0, 2.0 * side / size**2


def predict(
    mean: FloatArray,
    covariance: FloatArray,
    step: Discretised,
    F: FloatArray,
    q: ProcessNoise,
    log_variance: float,
    c: ModelConstants,
) -> tuple[FloatArray, FloatArray]:
    """Predict all tracks over a step: m⁻ = F m, P⁻ = F P Fᵀ + Q.

    Args:
        mean: (N, 2, 7).
        covariance: (N, 2, 7, 7).
        step: the model over that time.
        F: (N, 1, 7, 7) transitions of the tracks, of `in_perspective`.
        q: densities of the process noise.
        log_variance: ln ρ² of the sides of the scene's boxes, for the errors that last.
        c: constants.
    """
    predicted = (F @ mean[..., None])[..., 0]
    growth = np.abs(predicted[:, :, GROWTH]).mean(axis=1)
    Q = np.repeat(process_covariance(object_size(mean), growth, step, q, c), 2, axis=1)
    # σ² (1 − φ²), with φ = e^(−Δ/τ): the error keeps its variance.
    forgotten = 1.0 - step.F[POSITION_ERROR, POSITION_ERROR] ** 2
    position, size = lasting_error(box_size(mean), log_variance, c)
    Q[..., POSITION_ERROR, POSITION_ERROR] += forgotten * position
    Q[..., SIZE_ERROR, SIZE_ERROR] += forgotten * size
    return predicted, F @ covariance @ F.transpose(0, 1, 3, 2) + Q


def expected_centre(mean: FloatArray) -> FloatArray:
    """Return the centre (N, 2) of the box that a detector is expected to give (px)."""
    return np.asarray(mean[:, :, POSITION] + mean[:, :, POSITION_ERROR])


def expected_size(mean: FloatArray) -> FloatArray:
    """Return width and height (N, 2) of the box that a detector is expected to give (px)."""
    return np.asarray(np.exp(mean[:, :, LOG_SIZE] + mean[:, :, SIZE_ERROR]))


def box_size(mean: FloatArray) -> FloatArray:
    """Return width and height (N, 2) in px."""
    return np.exp(mean[:, :, LOG_SIZE])


def object_size(mean: FloatArray) -> FloatArray:
    """Return the size √(width · height) (N,) in px."""
    size: FloatArray = np.exp(mean[:, :, LOG_SIZE].mean(axis=1))
    return size
