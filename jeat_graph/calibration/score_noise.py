"""How exact boxes are by their scores: a detector that is in doubt of a vehicle also draws its box less well.

Of every detector that this was measured of, the errors of the boxes of least score are two to five times
those of the boxes of most. One noise for all of them believes the first too much and the second too little.
"""

from __future__ import annotations

import itertools

import numpy as np
from scipy.optimize import isotonic_regression

from jeat_graph.config.sensors import LEAST_FACTOR, MOST_FACTOR
from jeat_graph.data.arrays import FloatArray

_MAX_KNOTS = 12
_LEAST_IN_BIN = 50
# As many boxes of the usual error keep a bin from claiming much on little.
_PSEUDO = 20.0
# Scores count where they raise the log likelihood by more: a Bayes factor that chance does not explain.
_LEAST_EVIDENCE = 10.0


def fit_score_noise(score: FloatArray, error: FloatArray) -> tuple[tuple[float, float], ...]:
    """Fit the factor on standard deviations by the score: isotonic regression on bins of as many boxes each.

    Errors of one vehicle resemble each other for seconds, and those of one box do, too: the evidence counts
    each box once.

    Args:
        score: (C,) of boxes that are of a vehicle.
        error: (C, 4) of centre and ln size, in units of the standard deviations that do not ask for scores.

    Returns:
        Up to 12 knots (score, factor), scores rising and factors falling, their mean square over the boxes 1;
        none where scores say nothing of it.
    """
    square = np.mean(error**2, axis=1)
    mean = float(square.mean()) if len(square) else 0.0
    if mean <= 0.0:
        return ()
    square = square / mean
    count = int(np.clip(len(score) // _LEAST_IN_BIN, 1, _MAX_KNOTS))
    # Boxes of one score are in one bin, however many they are.
    edges = np.unique(np.quantile(score, np.arange(1, count) / count))
    bins = np.searchsorted(edges, score, side="right")
    weight = np.bincount(bins).astype(float)
    used = weight > 0
    weight, centre = weight[used], np.bincount(bins, score)[used] / weight[used]
    value = (np.bincount(bins, square)[used] + _PSEUDO) / (weight + _PSEUDO)
    falling = isotonic_regression(value, weights=weight, increasing=False).x
    bins = (np.cumsum(used) - 1)[bins]
    falling *= len(score) / float(weight @ falling)
    evidence = 0.5 * float(np.sum(square - square / falling[bins] - np.log(falling[bins])))
    if evidence <= _LEAST_EVIDENCE:
        return ()
    factor = np.clip(np.sqrt(falling), LEAST_FACTOR, MOST_FACTOR)
    knots = [(round(float(s), 6), round(float(f), 4)) for s, f in zip(centre, factor, strict=True)]
    # Scores may crowd: two knots at one place would say two things of it.
    apart = [True, *(b[0] > a[0] for a, b in itertools.pairwise(knots))]
    return tuple(itertools.compress(knots, apart))


def factors(score: FloatArray, knots: tuple[tuple[float, float], ...]) -> FloatArray:
    """Return the factor (C,) on the standard deviations of boxes of these scores (C,)."""
    if not knots:
        return np.ones(len(score))
    at, value = np.array(knots).T
    return np.asarray(np.interp(score, at, value))
