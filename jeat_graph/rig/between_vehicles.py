"""What vehicles together say of what they share, how far they differ, and whether it says that a lens bends.

The errors of one vehicle's boxes are correlated, those of two vehicles are not: so the uncertainty is that of
a jackknife which leaves out one vehicle at a time (Efron and Stein, Annals of Statistics 9, 1981; for
clusters: CR3 of Bell and McCaffrey, Survey Methodology 28, 2002).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from jeat_graph.data.arrays import FloatArray
from jeat_graph.smoothers.gtsam.shared_paths import SharedPaths


class LensEvidence(NamedTuple):
    """Whether lenses bend, by one step from the map between lenses that do not.

    Attributes:
        statistic: Wald's, of both k1 being 0.
        p_value: how often vehicles would say as much of lenses that do not bend.
    """

    statistic: float
    p_value: float


def jackknife(solved: SharedPaths) -> FloatArray:
    """Return the covariance (m, m) of the shared unknowns, by leaving out one vehicle at a time.

    Args:
        solved: about its own solution: `shared` is near 0, and `vector` is what each vehicle pulls there.
    """
    whole = solved.information.sum(axis=0) + solved.prior
    number = len(solved.vector)
    left = solved.vector - solved.information @ solved.shared
    moved = np.stack(
        [np.linalg.solve(whole - own, pull) for own, pull in zip(solved.information, left, strict=True)]
    )
    inverse = np.linalg.inv(whole)
    cov = (number - 1) / number * moved.T @ moved + inverse @ solved.prior @ inverse
    return np.asarray(0.5 * (cov + cov.T))


def lens_evidence(solved: SharedPaths, lenses: slice) -> LensEvidence:
    """Test whether the lenses' k1 are 0, where the system is linearised about the best map with 0.

    Args:
        solved: the system with the lenses' unknowns.
        lenses: which of the shared unknowns they are.
    """
    found = solved.shared[lenses]
    statistic = float(found @ np.linalg.solve(jackknife(solved)[lenses, lenses], found))
    return LensEvidence(statistic, float(chi2.sf(statistic, len(found))))
