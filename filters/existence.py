"""Existence of tracks: Bayes on hits and misses, and each sensor's own chance to see a track."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray


@njit(cache=True)
def existence_after_hit(existence: float, evidence: float, tempering: float) -> float:
    """Probability of existence after a detection was taken: r Λ^β / (1 − r + r Λ^β).

    The Bernoulli update of integrated probabilistic data association (Musicki, Evans, Stankovic, "Integrated
    probabilistic data association", IEEE T-AC 39(6), 1994) with one hypothesis. The exponent β <= 1 allows
    for false boxes that repeat in time and so are no independent evidence.

    Args:
        existence: r before.
        evidence: ln Λ, the log likelihood ratio of the detection being the track's.
        tempering: β.
    """
    # The log odds are bounded so that neither certainty nor overflow can be reached.
    r = min(max(existence, 1e-9), 1.0 - 1e-9)
    odds = math.log(r / (1.0 - r)) + min(max(tempering * evidence, -20.0), 20.0)
    return 1.0 / (1.0 + math.exp(-min(max(odds, -20.0), 20.0)))


@njit(cache=True)
def existence_after_miss(existence: float, p_detect: float) -> float:
    """Probability of existence after a scan without a detection: r (1 − P_D) / (1 − r P_D)."""
    return existence * (1.0 - p_detect) / max(1.0 - existence * p_detect, 1e-12)


@njit(cache=True)
def hidden_after_miss(hidden: float, p_detect: float) -> float:
    """Probability of being hidden after a scan without a detection: h / (h + (1 − h) (1 − P_D)).

    Misses of one vehicle come in a row: occlusion, blur, standing still before an event camera. With this
    state, a row of misses soon says "hidden" and no longer "gone" (the two-state visibility of Musicki and
    Evans, "Joint integrated probabilistic data association", IEEE T-AES 40(3), 2004, per sensor).

    Args:
        hidden: h before.
        p_detect: P_D of this look if the vehicle is not hidden.
    """
    return hidden / max(hidden + (1.0 - hidden) * (1.0 - p_detect), 1e-12)


@njit(cache=True)
def motion_visibility(mean: FloatArray, blind_speed: float) -> float:
    """Factor on P_D of a sensor that is blind to what stands still: 1 − exp(−(|v| / v_blind)²).

    Args:
        mean: (2, 3) per axis [p, v, a].
        blind_speed: v_blind (px/s); 0 for a sensor that sees still things as well.
    """
    if blind_speed <= 0.0:
        return 1.0
    speed2 = mean[0, 1] ** 2 + mean[1, 1] ** 2
    return 1.0 - math.exp(-speed2 / (blind_speed * blind_speed))


@njit(cache=True)
def visible_fraction(box: FloatArray, width: float, height: float) -> float:
    """Fraction of a box's area that lies inside a picture of `width` x `height` px.

    Args:
        box: (4,) left, top, width, height (px).
        width: of the picture (px).
        height: of the picture (px).
    """
    w = min(box[0] + box[2], width) - max(box[0], 0.0)
    h = min(box[1] + box[3], height) - max(box[1], 0.0)
    if w <= 0.0 or h <= 0.0:
        return 0.0
    return float(w * h / (box[2] * box[3]))


@njit(cache=True)
def occluded_fraction(boxes: FloatArray, existence: FloatArray) -> FloatArray:
    """Fraction (N,) of each box that the one track in front which covers most of it hides.

    On a plane road the box that reaches further down stands nearer. A doubtful track hides in proportion to
    its existence.

    Args:
        boxes: (N, 4) left, top, width, height (px).
        existence: (N,) probability of existence.
    """
    num = boxes.shape[0]
    out = np.zeros(num)
    order = np.argsort(boxes[:, 0], kind="mergesort")
    for a in range(num):
        i = order[a]
        right = boxes[i, 0] + boxes[i, 2]
        for b in range(a + 1, num):
            k = order[b]
            if boxes[k, 0] >= right:
                break
            width = min(right, boxes[k, 0] + boxes[k, 2]) - boxes[k, 0]
            bottom_i = boxes[i, 1] + boxes[i, 3]
            bottom_k = boxes[k, 1] + boxes[k, 3]
            height = min(bottom_i, bottom_k) - max(boxes[i, 1], boxes[k, 1])
            if height <= 0.0:
                continue
            behind, front = (i, k) if bottom_i < bottom_k else (k, i)
            covered = existence[front] * width * height / (boxes[behind, 2] * boxes[behind, 3])
            out[behind] = max(out[behind], covered)
    return out


@njit(cache=True)
def track_boxes(mean: FloatArray, size_mean: FloatArray) -> FloatArray:
    """Boxes (N, 4) left, top, width, height (px) of tracks.

    Args:
        mean: (N, 2, 3) per axis [p, v, a].
        size_mean: (N, 2, 2) ln width and ln height with their rates.
    """
    out = np.empty((mean.shape[0], 4))
    for i in range(mean.shape[0]):
        # A runaway extrapolation of a size must not overflow: e^12 px is beyond any picture.
        w = math.exp(min(max(size_mean[i, 0, 0], -12.0), 12.0))
        h = math.exp(min(max(size_mean[i, 1, 0], -12.0), 12.0))
        out[i, 0] = mean[i, 0, 0] - 0.5 * w
        out[i, 1] = mean[i, 1, 0] - 0.5 * h
        out[i, 2] = w
        out[i, 3] = h
    return out
