"""What the tracks that one sensor begins alone are worth, by their scores: learnt from what became of them.

A detector takes some bush for a vehicle again and again. Boxes that come back to the place where they were
expected say that something is there, not that it is a vehicle: beside "a vehicle" and "chance" there is a
third cause, a false thing. Where no other sensor has seen a track, only its score can tell the two apart,
and what a score means differs between detectors. What shows itself is whether things of that score last. So
for each sensor the probability that a box belongs to something that lasts is

    q(p) = 1 / (1 + exp(−a − b ln(p / (1 − p)))),

with p the precision that the sensor's curve gives for its score. Where such a curve was measured, it is
believed at first, a = 0 and b = 1; where nobody says what scores mean, p is nearly the score itself. The two
numbers (a, b) are learnt by Bayes' rule while the tracker runs, each box weighing as much as the
time it stands for (logistic regression step by step: Spiegelhalter, Lauritzen, "Sequential updating of
conditional probabilities on directed graphical structures", Networks 20, 1990). A sensor whose scores say
nothing ends with b = 0: then none of its tracks is told from another.
"""

from __future__ import annotations

import math

from numba import njit

from jeat_graph.data.arrays import FloatArray

_MOST_ODDS = 30.0


@njit(cache=True)
def worth_of(mean: FloatArray, odds: float) -> float:
    """Return q, the probability that what has these log odds of the score lasts.

    Args:
        mean: (2,) a and b.
        odds: mean log odds of its scores.
    """
    x = mean[0] + mean[1] * odds
    return 1.0 / (1.0 + math.exp(-min(max(x, -_MOST_ODDS), _MOST_ODDS)))


@njit(cache=True)
def learn_worth(mean: FloatArray, cov: FloatArray, odds: float, lasts: bool, weight: float) -> None:
    """Take in, in place, what became of a box: one step of Newton's method on the new posterior.

    Args:
        mean: (2,) a and b; b stays >= 0, for no detector's scores mean the opposite.
        cov: (2, 2) their covariance.
        odds: log odds of its score.
        lasts: whether it belongs to something that lasts.
        weight: how much of an independent witness it is.
    """
    q = worth_of(mean, odds)
    first, second = cov[0, 0] + cov[0, 1] * odds, cov[0, 1] + cov[1, 1] * odds
    information = weight * q * (1.0 - q)
    shrink = 1.0 / (1.0 + information * (first + second * odds))
    gain = weight * shrink * ((1.0 if lasts else 0.0) - q)
    mean[0] += first * gain
    mean[1] = max(mean[1] + second * gain, 0.0)
    lost = information * shrink
    cov[0, 0] -= lost * first * first
    cov[0, 1] -= lost * first * second
    cov[1, 0] = cov[0, 1]
    cov[1, 1] -= lost * second * second


@njit(cache=True)
def doubt_worth(cov: FloatArray, most: float, step: float) -> None:
    """Let what was learnt age, in place: a random walk, up to the variance of the first assumptions.

    Args:
        cov: (2, 2) covariance of a and b.
        most: that variance.
        step: time passed, as a fraction of the time in which all is forgotten.
    """
    for k in range(2):
        cov[k, k] = min(cov[k, k] + step * most, most)
