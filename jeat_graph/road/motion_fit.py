"""One vehicle's motion on the road from where it was seen; its variances count errors that persist.

The motion along and across the road is a constant acceleration plus random jerks at evenly spaced knots, a
linear model with a Gaussian prior. What is seen is wrong by white noise and by an error that persists for a
while (a first-order Gauss-Markov process in the picture: the tracked point creeps over the body). So every
number that is asked for (a mean speed, the time at a line) is a linear function of the points seen, whose
gain gives its variance by noise and, with the camera's derivative, its variance by calibration.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from jeat_graph.config.fields import check, number
from jeat_graph.data.arrays import FloatArray
from jeat_graph.road.robust import agreed_weights, believed_span, kernel

_ROBUST_PASSES = 5
_STIFF_PASSES = 3
ANYWHERE_M = 1e3


@dataclass(frozen=True)
class MotionFitConfig:
    """How vehicles move and how a tracked point errs."""

    white_px: float = number(0.5, "px", "error of a point that is new in every picture", open_low=True)
    memory_px: float = number(1.0, "px", "error of a point that persists", open_low=True)
    memory_s: float = number(0.3, "s", "for how long it does", open_low=True)
    speed_sd: float = number(60.0, "m/s", "spread of speeds along the road", open_low=True)
    acceleration_sd: float = number(0.4, "m/s²", "spread of accelerations along the road", open_low=True)
    jerk: float = number(0.2, "m/s^2.5", "root spectral density of jerk along the road", open_low=True)
    lateral_factor: float = number(0.3, "1", "motion across the road / motion along it", open_low=True)
    knot_s: float = number(1.0, "s", "distance of the knots", open_low=True)
    most_knots: int = number(40, "knots", "for longer tracks they are farther apart", 1)
    node_s: float = number(
        0.08, "s", "neighbours this close together are fitted as their mean", open_low=True
    )
    most_nodes: int = number(150, "points", "for longer tracks more of them are", 4)
    edge_share: float = number(0.01, "1", "points this near the edge are cut by it / height of the picture")
    soft: float = number(2.5, "1", "residual / error at which a point's weight is a quarter", open_low=True)

    def __post_init__(self) -> None:
        check(self)


class MotionFit(NamedTuple):
    """A vehicle's motion: place p(t) = B(t) c on each axis.

    Attributes:
        t0: the time that the polynomials count from (s).
        knots: (J,) times of the random jerks (s), relative to t0.
        coefficients: (2, C) by axis: x across, y along.
        covariance: (2 C, 2 C) of both, by noise alone.
        gain: (2 C, M, 2) derivative of the coefficients with respect to the M places fitted.
        t: (M,) the times fitted (s).
        residual: (M, 2) in standard deviations.
        weight: (M,) robust weights.
    """

    t0: float
    knots: FloatArray
    coefficients: FloatArray
    covariance: FloatArray
    gain: FloatArray
    t: FloatArray
    residual: FloatArray
    weight: FloatArray

    def window(self) -> tuple[float, float]:
        """First and last time that the fit believes (s): ends of a track that wander off do not count."""
        return believed_span(self.t, self.weight)

    def basis(self, t: FloatArray, derivative: int = 0) -> FloatArray:
        """Rows B (..., C) whose product with the coefficients is place, speed or acceleration at t (s)."""
        return basis_rows(np.asarray(t, dtype=np.float64) - self.t0, self.knots, derivative)

    def at(self, t: FloatArray, derivative: int = 0) -> FloatArray:
        """Place (m), speed (m/s) or acceleration (m/s²), (..., 2), at times t (...)."""
        return np.asarray(self.basis(t, derivative) @ self.coefficients.T, dtype=np.float64)


def basis_rows(s: FloatArray, knots: FloatArray, derivative: int) -> FloatArray:
    """Constant, linear and quadratic motion, and what a unit step of acceleration at each knot adds."""
    one = np.ones_like(s)
    after = np.maximum(s[..., None] - knots, 0.0)
    if derivative == 0:
        parts, steps = [one, s, s**2 / 2.0], after**2 / 2.0
    elif derivative == 1:
        parts, steps = [0.0 * one, one, s], after
    else:
        parts, steps = [0.0 * one, 0.0 * one, one], np.asarray(s[..., None] > knots, dtype=np.float64)
    return np.concatenate([np.stack(parts, axis=-1), steps], axis=-1)


def spaced_knots(s: FloatArray, config: MotionFitConfig) -> FloatArray:
    """Evenly spaced times (J,) of random jerks between the first and the last of s (s)."""
    span = float(s[-1] - s[0])
    count = int(min(max(np.ceil(span / config.knot_s) - 1, 0), config.most_knots))
    return np.asarray(s[0] + span * np.arange(1, count + 1) / (count + 1), dtype=np.float64)


def motion_prior(s: FloatArray, knots: FloatArray, config: MotionFitConfig) -> FloatArray:
    """Precision (2 C, 2 C) of the coefficients, x before y: across the road everything is calmer."""
    step = float(s[-1] - s[0]) / (len(knots) + 1)
    jerks = np.full(len(knots), config.jerk**2 * step)
    along = np.r_[ANYWHERE_M**2, config.speed_sd**2, config.acceleration_sd**2, jerks]
    across = along * np.r_[1.0, np.full(len(along) - 1, config.lateral_factor**2)]
    return np.diag(1.0 / np.concatenate([across, along]))


def error_covariance(t: FloatArray, config: MotionFitConfig, counts: FloatArray) -> FloatArray:
    """Covariance (M, M) in px² of the errors of one coordinate at times t; means of `counts` points."""
    apart = np.abs(t[:, None] - t[None, :])
    return np.asarray(
        config.memory_px**2 * np.exp(-apart / config.memory_s) + np.diag(config.white_px**2 / counts)
    )


def fit_motion(
    t: FloatArray, xy: FloatArray, to_road: FloatArray, config: MotionFitConfig, counts: FloatArray
) -> MotionFit:
    """Fit one vehicle's places.

    Args:
        t: (M,) times, ascending (s).
        xy: (M, 2) places on the road (m).
        to_road: (M, 2, 2) metres on the road per pixel there: the error is the same everywhere in the
            picture.
        config: how vehicles move and points err.
        counts: (M,) how many points each is the mean of.
    """
    t0 = float(t.mean())
    s = t - t0
    knots = spaced_knots(s, config)
    B = basis_rows(s, knots, 0)
    n, C = len(t), B.shape[1]
    prior = motion_prior(s, knots, config)
    design = np.zeros((n, 2, 2, C))
    design[:, 0, 0] = design[:, 1, 1] = B
    centre = np.zeros(2 * C)
    middle = xy.mean(axis=0)
    centre[0], centre[C] = middle
    errors = error_covariance(s, config, counts)
    inverse_px = np.linalg.inv(to_road)
    # In the picture's metric both coordinates have equal, independent errors.
    A = np.einsum("nij,njkc->nikc", inverse_px, design).reshape(n, 2, 2 * C)
    b = np.einsum("nij,nj->ni", inverse_px, xy - middle)
    size = np.sqrt(np.diag(errors))
    weight = agreed_weights(s[None], xy[None], (inverse_px / size[:, None, None])[None], config.soft)[0]
    stiff = prior.copy()
    if len(knots):
        # First without the jerks: a motion that can bend would follow a point that leaves the vehicle.
        bends = np.r_[3:C, C + 3 : 2 * C]
        stiff[bends, bends] *= 1e6

    def solve(weight: FloatArray, belief: FloatArray) -> tuple[FloatArray, ...]:
        """Coefficients, covariance, derivatives by the places, residuals, and weights by these residuals."""
        root = 1.0 / np.sqrt(np.maximum(weight, 1e-8))
        # A doubtful point is given more white noise of its own; what it shares with its neighbours stays.
        factor = cho_factor(errors + np.diag(size**2 * (root**2 - 1.0)))
        solved = cho_solve(factor, A.reshape(n, -1)).reshape(n, 2, 2 * C)
        inverse = np.linalg.inv(np.einsum("nia,nib->ab", A, solved) + belief)
        gain_px = np.einsum("ab,nib->ani", inverse, solved)
        c = np.einsum("ani,ni->a", gain_px, b)
        residual = (b - A @ c) / size[:, None]
        return c, inverse, gain_px, residual, kernel(np.linalg.norm(residual, axis=1), config.soft)

    for _ in range(_STIFF_PASSES):
        *_, weight = solve(weight, stiff)
    for _ in range(_STIFF_PASSES, _ROBUST_PASSES - 1):
        *_, weight = solve(weight, prior)
    c, inverse, gain_px, residual, weight = solve(weight, prior)
    gain = np.einsum("ani,nij->anj", gain_px, inverse_px)
    return MotionFit(
        t0, knots, (c + centre).reshape(2, C), (inverse + inverse.T) / 2.0, gain, t, residual, weight
    )


def thinned(
    t: FloatArray, pixels: FloatArray, config: MotionFitConfig
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Means of neighbouring points: times (M,), pixels (M, 2), counts (M,)."""
    span = float(t[-1] - t[0])
    most = int(min(max(np.ceil(span / config.node_s), 4), config.most_nodes))
    if len(t) <= most:
        return t, pixels, np.ones(len(t))
    group = np.minimum(((t - t[0]) / span * most).astype(np.int64), most - 1)
    counts = np.bincount(group, minlength=most).astype(np.float64)
    there = counts > 0
    mean = [
        np.bincount(group, values, minlength=most)[there] / counts[there]
        for values in (t, pixels[:, 0], pixels[:, 1])
    ]
    return mean[0], np.stack(mean[1:], axis=1), counts[there]
