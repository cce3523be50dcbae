"""At which score a sensor's box is as likely real as not: its decision threshold.

What is real is there again in the next scan, and was there in the one before. So for each score the share of
boxes is counted that come again at their place (IoU) in both neighbouring scans, relative to that of the
sensor's best boxes. z₀ is the logit below which that share is under one half, and the decision threshold in
logits is θ = b₀ + b₁ · clip(z₀), with b₀ and b₁ measured on real detectors.
False boxes that repeat make z₀ too low: it bounds, and hits, misses and other sensors tell the rest.

It also tests whether scores are evidence at all. The scores of one object correlate from scan to scan (.45 to
.93 in real detectors); where they do not, they are no property of the object.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.special import expit

from jeat_graph.association.assignment import assign
from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.filters.box_sides import intersection_over_union
from jeat_graph.filters.model_constants import ModelConstants

# Logits at which the share is estimated (the first, their distance, how many), and the kernel's bandwidth.
_FIRST_LOGIT, _LOGIT_STEP, _SCORE_BINS = -4.5, 0.25, 47
#: These logits.
SCORE_GRID = _FIRST_LOGIT + _LOGIT_STEP * np.arange(_SCORE_BINS)
_BANDWIDTH = 0.35
# The share of the best boxes that divides the others starts with the prior of so many boxes.
_BEST_COUNT = 5.0
_LEAST_BOXES = 1e-9
# Scores are kept this far from 0 and 1, lest a logit be infinite.
_LEAST_SCORE = 1e-3
# Scores that vary by less than this (logits²) are one score; and the greatest correlation.
_LEAST_VARIANCE, _MOST_CORRELATION = 1e-6, 0.999
# z₀ before anything is counted.
_FIRST_Z = 0.0


class PreviousScan(NamedTuple):
    """A sensor's last scan: boxes (M, 4), logits (M,), which had a box at their place in the one before."""

    boxes: FloatArray
    logits: FloatArray
    had_before: BoolArray


class PairSums(NamedTuple):
    """Sums over pairs of numbers (x, y), for their correlation.

    Attributes:
        pairs: their number.
        first, second: Σ x, Σ y.
        first_squared, second_squared, product: Σ x², Σ y², Σ x y.
    """

    pairs: float
    first: float
    second: float
    first_squared: float
    second_squared: float
    product: float


class RepeatCounts(NamedTuple):
    """What is counted of one sensor.

    Attributes:
        boxes: (G,) boxes by score, at the logits of `SCORE_GRID`.
        repeated: (G,) those of them that came again in both neighbouring scans.
        persistence: logits of boxes that came again in the next scan, before and after.
        recurrence: logits, and whether the box came again (1) or not (0).
        scans: number of scans.
        last: the last one; None before the first.
    """

    boxes: FloatArray
    repeated: FloatArray
    persistence: PairSums
    recurrence: PairSums
    scans: int
    last: PreviousScan | None


def no_repetition() -> RepeatCounts:
    """Return the counts of a sensor before its first scan."""
    none = PairSums(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return RepeatCounts(np.zeros(len(SCORE_GRID)), np.zeros(len(SCORE_GRID)), none, none, 0, None)


def logit(score: FloatArray) -> FloatArray:
    """Return ln(s / (1 − s)) of scores (M,), bounded."""
    # As np.clip, which takes longer than the rest for the boxes of one scan.
    bounded = np.minimum(np.maximum(score, _LEAST_SCORE), 1.0 - _LEAST_SCORE)
    return np.asarray(np.log(bounded / (1.0 - bounded)))


def box_probability(boxes: FloatArray, logits: FloatArray, threshold: float) -> FloatArray:
    """Return the probability (M,) of each box to be an object by itself, whatever is tracked there.

    Its odds are those of its score, times 1 − IoU with the most overlapping better box of the scan: of two
    boxes at one place the worse one is mostly a second box of the same object.

    Args:
        boxes: (M, 4) left, top, right, bottom of one scan (px).
        logits: (M,) of their scores.
        threshold: θ of the sensor; logit − θ is the log odds by score.
    """
    overlap = np.where(logits[None] > logits[:, None], intersection_over_union(boxes, boxes), 0.0)
    apart = 1.0 - overlap.max(axis=1, initial=0.0)
    odds = np.exp(logits - threshold) * apart
    return np.asarray(odds / (1.0 + odds))


def count_repetition(
    counts: RepeatCounts, boxes: FloatArray, logits: FloatArray, c: ModelConstants
) -> RepeatCounts:
    """Count which boxes of the scan before have one at their place on both sides.

    Args:
        counts: of the sensor so far.
        boxes: (M, 4) left, top, right, bottom of the scan now (px).
        logits: (M,) of their scores.
        c: constants.
    """
    had_before = np.zeros(len(boxes), dtype=np.bool_)
    total, repeated = counts.boxes, counts.repeated
    persistence, recurrence = counts.persistence, counts.recurrence
    if counts.last is not None:
        last = counts.last
        has_after = np.zeros(len(last.boxes), dtype=np.bool_)
        if len(boxes) and len(last.boxes):
            overlap = intersection_over_union(last.boxes, boxes)
            possible = np.where(overlap >= c.repeat_overlap, overlap, 0.0)
            i, j = assign(possible, c.exact_assignment)
            has_after[i], had_before[j] = True, True
            persistence = _added(persistence, last.logits[i], logits[j])
        if len(boxes):
            recurrence = _added(recurrence, last.logits, has_after.astype(np.float64))
        if len(last.boxes) and counts.scans > 1:
            kernel = _kernel(last.logits)
            total = total + kernel.sum(axis=1)
            repeated = repeated + kernel @ (has_after & last.had_before)
    return RepeatCounts(
        total, repeated, persistence, recurrence, counts.scans + 1, PreviousScan(boxes, logits, had_before)
    )


def half_as_many(counts: RepeatCounts, c: ModelConstants) -> float:
    """Return z₀: the logit below which fewer than half as many boxes come again as of the best ones."""
    total, repeated = counts.boxes, counts.repeated
    if total.sum() <= 0.0:
        return _FIRST_Z
    best = np.cumsum(total[::-1])[::-1] <= c.best_share * total.sum()
    best[-1] = True
    top = (repeated[best].sum() + _BEST_COUNT * c.repeat_share) / (total[best].sum() + _BEST_COUNT)
    # Where even the best hardly come again, since all moves far from one scan to the next, counts say little.
    trusted = total * min(1.0, (top / c.repeat_trusted) ** 2)
    prior = c.repeat_count * c.repeat_share
    share = (trusted * repeated / (total * top + _LEAST_BOXES) + prior) / (trusted + c.repeat_count)
    low = np.flatnonzero(share < 0.5)
    return float(SCORE_GRID[low[-1] if len(low) else 0])


def decision_threshold(counts: RepeatCounts, c: ModelConstants) -> float:
    """Return θ: logit − θ is the log odds that a box is real, by its score alone."""
    z = float(np.clip(half_as_many(counts, c), *c.threshold_bounds))
    return c.threshold_offset + c.threshold_slope * z


def meaning(counts: RepeatCounts, c: ModelConstants) -> float:
    """Return the probability that a sensor's scores say something of what its boxes are of.

    If they do, the scores of one object correlate from scan to scan, or boxes that come again have higher
    scores than others. If they do not, their variance is that of all scores of a detector. A small variance,
    as of one object seen alone or of equal scores, is therefore no evidence against them.
    """
    before, after = _variances(counts.persistence)
    spread = math.sqrt(max(before, 0.0) * max(after, 0.0))
    odds = math.log(c.no_meaning_share / (1.0 - c.no_meaning_share))
    # Where all boxes come again, or all move too far to, the second says nothing: it speaks for scores alone.
    odds -= log_factor(counts.persistence, c) + max(log_factor(counts.recurrence, c), 0.0)
    return 1.0 - float(expit(odds)) * min(1.0, spread / c.agreed_std**2)


def log_factor(sums: PairSums, c: ModelConstants) -> float:
    """Return the log Bayes factor of pairs that have to do with each other, against such as have not.

    By Fisher's transform x = atanh r of their correlation r is normal about atanh ρ with the variance 1/n;
    atanh ρ has the standard deviation 1 in the one case and `no_meaning_std` in the other (Fisher, "Frequency
    distribution of the values of the correlation coefficient", Biometrika 10, 1915). r below 0 counts as 0.
    """
    n, variance = sums.pairs, _variances(sums)
    if not min(variance) > _LEAST_VARIANCE:
        return 0.0
    covariance = sums.product / n - sums.first * sums.second / n**2
    r = covariance / math.sqrt(variance[0] * variance[1])
    x = math.atanh(min(max(r, 0.0), _MOST_CORRELATION))
    without, having = 1.0 / n + c.no_meaning_std**2, 1.0 / n + 1.0
    return 0.5 * (math.log(without / having) + x * x * (1.0 / without - 1.0 / having))


def _variances(sums: PairSums) -> tuple[float, float]:
    """Return the variances of both numbers, 0 before anything is counted."""
    n = max(sums.pairs, 1.0)
    return sums.first_squared / n - (sums.first / n) ** 2, sums.second_squared / n - (sums.second / n) ** 2


def _added(sums: PairSums, x: FloatArray, y: FloatArray) -> PairSums:
    """Return the sums with pairs (K,), (K,)."""
    moments = len(x), x.sum(), y.sum(), x @ x, y @ y, x @ y
    return PairSums(*(float(a + b) for a, b in zip(sums, moments, strict=True)))


def _kernel(logits: FloatArray) -> FloatArray:
    """Return the share (G, M) of each box in each place of the grid: a Gaussian kernel of the grid's step."""
    step = SCORE_GRID[1] - SCORE_GRID[0]
    normal = np.exp(-0.5 * ((SCORE_GRID[:, None] - logits) / _BANDWIDTH) ** 2)
    return np.asarray(normal * (step / _BANDWIDTH / np.sqrt(2.0 * np.pi)))
