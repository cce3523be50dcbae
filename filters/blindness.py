"""Probability that a sensor is blind as a whole for now: dazzled, covered, in the dark, or failed.

A sensor that finds nothing where many vehicles were expected did not miss each of them by a chance of its
own: the misses have a common cause. Each sensor is a hidden Markov chain of two states, "sees" and "blind",
that takes one step a scan (Rabiner, "A tutorial on hidden Markov models", Proc. IEEE 77(2), 1989). Under
"blind" all its boxes are false ones; under "sees" track i gives a detection with probability r_i P_D,i. What
`ratio_of_*` return is ln p(scan | blind) − ln p(scan | sees), to be summed over tracks and leftovers.
"""

from __future__ import annotations

import math

from numba import njit

# Neither state is ever certain, so that both can be left.
_SURE = 1e-6
_MOST_EVIDENCE = 30.0


@njit(cache=True)
def blind_before_scan(blind: float, sight_scans: float, blind_scans: float) -> float:
    """Predict the probability of being blind by one scan.

    Args:
        blind: probability after the last scan.
        sight_scans: mean number of scans until a sensor that sees goes blind.
        blind_scans: mean number of scans for which it then is blind.
    """
    return blind + (1.0 - blind) / sight_scans - blind / blind_scans


@njit(cache=True)
def ratio_of_miss(existence: float, p_detect: float) -> float:
    """Return what a track that the scan did not find adds: −ln(1 − r P_D)."""
    return -math.log1p(-min(existence * p_detect, 1.0 - _SURE))


@njit(cache=True)
def ratio_of_hit(existence: float, p_detect: float, evidence: float) -> float:
    """Return what a track that took a detection adds: −ln(1 − r P_D + r Λ).

    Args:
        existence: r.
        p_detect: P_D.
        evidence: ln Λ, the log likelihood ratio of the detection being the track's and not clutter.
    """
    found = existence * math.exp(min(evidence, _MOST_EVIDENCE))
    return -math.log(max(1.0 - existence * p_detect + found, _SURE))


@njit(cache=True)
def ratio_of_leftover(newcomer: float) -> float:
    """Return what a detection that no track took adds: ln(1 − q).

    Args:
        newcomer: q, the probability that it is of a vehicle, if the sensor sees.
    """
    return math.log1p(-min(newcomer, 1.0 - _SURE))


@njit(cache=True)
def blind_after_scan(blind: float, ratio: float) -> float:
    """Probability of being blind after a scan: Bayes' rule on its odds.

    Args:
        blind: probability before the scan.
        ratio: ln p(scan | blind) − ln p(scan | sees).
    """
    prior = min(max(blind, _SURE), 1.0 - _SURE)
    odds = math.log(prior / (1.0 - prior)) + ratio
    after = 1.0 / (1.0 + math.exp(-min(max(odds, -_MOST_EVIDENCE), _MOST_EVIDENCE)))
    return min(max(after, _SURE), 1.0 - _SURE)
