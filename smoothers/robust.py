"""Weights of measurements for whole-track smoothing that outliers cannot spoil.

Iterative re-weighting with annealing: the kernel starts so wide that it is nearly quadratic and is
narrowed step by step (graduated non-convexity), so that the first, spoiled solution does not decide
which measurements are the outliers. Each iteration costs one RTS pass, whatever engine solves in the end.

What is weighed is how well a measurement agrees with *all others*: its leave-one-out residual, which
follows from the smoothed state in closed form. An outlier can not hide behind the pull that it exerts,
and on clean data the squared distance is χ² with two degrees of freedom by the model, so that a clean
track is left as it is.
"""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import ConfigError
from jeat_graph.smoothers.rts import smooth_rts
from jeat_graph.smoothers.track_data import MOTION, SmoothedTrack, TrackData

#: Names of the kernels.
KERNELS = ("cauchy", "student-t")

#: Squared distance up to which a measurement keeps its full weight: χ² with two degrees of freedom
#: stays below it with probability 0.999.
INLIER_LIMIT = 2.0 * np.log(1000.0)

#: Degrees of freedom among which Student's t chooses, and infinity (no outliers).
_FREEDOMS = np.array([1.5, 2.0, 3.0, 4.0, 6.0, 10.0, 20.0])

_ANNEALING = 2.0
_MOST_ITERATIONS = 40
_CONVERGED = 1e-3


def robust_weights(track: TrackData, kernel: str = "cauchy") -> FloatArray:
    """Return a factor on the information of each measurement's white part, in (0, 1] for "cauchy".

    - "cauchy": 1 up to `INLIER_LIMIT`, and Cauchy's 1 / (1 + (d² - limit) / s²) beyond, s² annealed to 1.
    - "student-t": (ν + 2) / (ν + d²) (d² annealed), with ν chosen by likelihood, ν = ∞ unless the track
      shows heavy tails by more than chance (Bayesian information criterion).

    Source: Yang, Antonante, Tzoumas, Carlone, Graduated Non-Convexity for Robust Spatial Perception,
    RA-L 2020 (annealing); Lange, Little, Taylor, JASA 84, 1989 (Student's t).

    Args:
        track: the data.
        kernel: one of `KERNELS`.

    Returns:
        (M,) weights.

    Raises:
        ConfigError: if there is no such kernel.
    """
    if kernel not in KERNELS:
        raise ConfigError(f"the robust kernel must be one of {', '.join(KERNELS)}, not {kernel!r}")
    weights = np.ones(len(track.z))
    distance = left_out_distances(track, smooth_rts(track), weights)
    if not _more_than_chance(distance):
        return weights
    width = float(distance.max())
    for _ in range(_MOST_ITERATIONS):
        if kernel == "cauchy":
            new = 1.0 / (1.0 + np.maximum(distance - INLIER_LIMIT, 0.0) / width)
        else:
            new = _student_weights(distance / width)
        settled = width == 1.0 and np.abs(new - weights).max(initial=0.0) < _CONVERGED
        weights = new
        if settled:
            break
        width = max(width / _ANNEALING, 1.0)
        distance = left_out_distances(track, smooth_rts(track, weights), weights)
    return weights


def left_out_distances(track: TrackData, smoothed: SmoothedTrack, weights: FloatArray) -> FloatArray:
    """Squared Mahalanobis distance of each measurement from what all the others predict.

    With the smoothed variance P and leverage h = w P / r, the residual e becomes e / (1 - h) and the
    variance P / (1 - h) once the measurement is taken out (Cook, Weisberg, Residuals and Influence, 1982).

    Args:
        track: the data.
        smoothed: its smoothed states, solved with `weights`.
        weights: (M,) factor on the information of each measurement's white part.

    Returns:
        (M,) distances d², χ² with two degrees of freedom if the model holds.
    """
    # With a coloured error the measurement is of p + h e: H = [1, 0, 0, …, h, …].
    H = np.zeros((len(track.z), 2, track.size))
    H[:, :, 0] = 1.0
    coloured = np.flatnonzero(track.error >= 0)
    H[coloured, :, MOTION + track.error[coloured]] = track.coloured_std[coloured]
    P = np.einsum("mai,maij,maj->ma", H, smoothed.cov[track.key], H)
    residual = track.z - np.einsum("mai,mai->ma", H, smoothed.mean[track.key])
    # A measurement that alone determines its state has leverage 1 and says nothing about itself.
    rest = np.maximum(1.0 - weights[:, None] * P / track.r, 1e-9)
    return np.asarray(((residual / rest) ** 2 / (track.r + P / rest)).sum(axis=1))


def _more_than_chance(distance: FloatArray) -> bool:
    """Whether squared distances (M,) show outliers; clean tracks are to be left exactly as they are.

    That is: more of them beyond the limit than chance puts there (three standard deviations), or one
    that is too large for the largest of so many (each of these about once in a thousand clean tracks).
    """
    expected = len(distance) / 1000.0
    beyond = np.count_nonzero(distance > INLIER_LIMIT)
    largest = INLIER_LIMIT + 2.0 * np.log(max(len(distance), 1))
    return bool(beyond > 1.0 + expected + 3.0 * np.sqrt(expected) or distance.max(initial=0.0) > largest)


def _student_weights(distance: FloatArray) -> FloatArray:
    """Weights (M,) of Student's t in two dimensions, its degrees of freedom chosen by likelihood."""
    nu = _FREEDOMS[:, None]
    likelihood = -0.5 * (nu + 2.0) * np.log1p(distance / nu)
    total = likelihood.sum(axis=1)
    best = int(np.argmax(total))
    if total[best] + 0.5 * distance.sum() < 0.5 * np.log(max(len(distance), 2)):
        return np.ones(len(distance))
    freedom = _FREEDOMS[best]
    return np.asarray((freedom + 2.0) / (freedom + distance))
