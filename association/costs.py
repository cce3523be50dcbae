"""Costs of giving a detection to a track.

The paper's cost is the squared Mahalanobis distance, which `gates.gated_pairs` returns. It prefers, for the
same residual, the *less* certain sensor and the *less* confident detection, because d² falls as R grows. The
likelihood ratio has the term ln det S and so does not have this fault.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.association.gates import Pairs
from jeat_graph.data.arrays import FloatArray, IntArray


@njit(cache=True)
def log_score_ratio(calibrated: float, overall: float) -> float:
    """Logarithm of p(score | vehicle) / p(score | false box).

    By Bayes' rule it follows from the precision at this score and the precision over all scores.

    Args:
        calibrated: precision of a box of this score, in (0, 1).
        overall: precision of all boxes of the sensor, in (0, 1).
    """
    return float(math.log(calibrated / (1.0 - calibrated)) - math.log(overall / (1.0 - overall)))


@njit(cache=True)
def log_evidence(
    pairs: Pairs,
    p_detect: FloatArray,
    log_score: FloatArray,
    log_clutter: FloatArray,
    sensor: IntArray,
) -> FloatArray:
    """Log likelihood ratio that a detection is the track's rather than clutter.

    ln Λ = ln P_D + ln p(y) + ln p(size residual) + ln LR(score) − ln λ, with p normal or Student's t.

    Args:
        pairs: the P pairs inside the gates.
        p_detect: (N, S) probability that sensor s detects track i now.
        log_score: (M,) `log_score_ratio` of each detection.
        log_clutter: (S,) ln of the clutter density (per px² and (ln px)², in one scan).
        sensor: (M,) sensor of each detection.

    Returns:
        (P,) ln Λ.
    """
    rows = pairs.rows
    out = np.empty(len(rows))
    for p in range(len(rows)):
        j = pairs.cols[p]
        s = sensor[j]
        out[p] = (
            math.log(max(p_detect[rows[p], s], 1e-12))
            + pairs.log_density[p]
            + pairs.log_size_density[p]
            + log_score[j]
            - log_clutter[s]
        )
    return out


@njit(cache=True)
def likelihood_cost(
    rows: IntArray,
    cols: IntArray,
    evidence: FloatArray,
    existence: FloatArray,
    p_detect: FloatArray,
    sensor: IntArray,
) -> FloatArray:
    """Cost of a pair against leaving the track missed and the detection to clutter; negative where it pays.

    c = −[ln Λ + ln r − ln(1 − r P_D)], the ratio of the two hypotheses of a Bernoulli track
    (Williams, "Marginal multi-Bernoulli filters", IEEE T-AES 51(3), 2015).

    Args:
        rows: (P,) track of each pair.
        cols: (P,) detection of each pair.
        evidence: (P,) ln Λ of `log_evidence`.
        existence: (N,) probability r that the track exists.
        p_detect: (N, S) probability that sensor s detects track i now.
        sensor: (M,) sensor of each detection.

    Returns:
        (P,) costs.
    """
    out = np.empty(len(rows))
    for p in range(len(rows)):
        r = existence[rows[p]]
        missed = 1.0 - r * p_detect[rows[p], sensor[cols[p]]]
        out[p] = -(evidence[p] + math.log(max(r, 1e-12)) - math.log(max(missed, 1e-12)))
    return out
