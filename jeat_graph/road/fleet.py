"""Kinds of vehicles and how large they are: the prior of a vehicle's length, width and height."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jeat_graph.core import road as core
from jeat_graph.data.arrays import FloatArray


class VehicleClass(NamedTuple):
    """A kind of vehicle as fleets have it.

    Attributes:
        name: what it is called.
        share: of traffic.
        mean: length, width, height (m).
        spread: their standard deviations (m).
    """

    name: str
    share: float
    mean: tuple[float, float, float]
    spread: tuple[float, float, float]


#: Rough sizes of bodies without mirrors, wide enough that a vehicle of each kind lies within two deviations.
CLASSES = (
    VehicleClass("motorcycle", 0.01, (2.2, 0.8, 1.5), (0.2, 0.1, 0.15)),
    VehicleClass("car", 0.74, (4.4, 1.83, 1.55), (0.35, 0.08, 0.12)),
    VehicleClass("van", 0.12, (5.6, 2.0, 2.35), (0.6, 0.08, 0.3)),
    VehicleClass("truck", 0.07, (9.0, 2.5, 3.5), (1.8, 0.08, 0.4)),
    VehicleClass("truck", 0.06, (14.5, 2.52, 3.8), (2.2, 0.06, 0.3)),
)

_MEANS = np.array([one.mean for one in CLASSES])
_SPREADS = np.array([one.spread for one in CLASSES])
_EACH = np.arange(3)
#: Least and greatest length, width, height (m) of all kinds, and how sizes of those kinds differ: (2, 2, 3).
EXTREMES = np.array(
    [[_MEANS[k, _EACH], _SPREADS[k, _EACH]] for k in (_MEANS.argmin(axis=0), _MEANS.argmax(axis=0))]
)
#: Squared distance beyond all kinds from which it is no vehicle: chi square, three sizes, one in 10,000.
MOST_BEYOND = 21.1


def beyond_vehicles(size: FloatArray, var: FloatArray) -> float:
    """Squared distance of a size from what lies between the smallest and the largest kind, in their spreads.

    What lies between two kinds, as a car with a trailer does, is no distance away.

    Args:
        size: (3,) length, width, height (m).
        var: (3,) variances of how it is known (m²).
    """
    return core.beyond_vehicles(size, var, EXTREMES)


def sizes_allowed(information: FloatArray, vector: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean (3,) and covariance (3, 3) of sizes of vehicles of the kinds that the boxes so far allow.

    Args:
        information: (3, 3) what the boxes alone tell of the size, as the inverse of its covariance.
        vector: (3,) that times the size that they tell.
    """
    score, means, covs = [], [], []
    for one in CLASSES:
        own = np.diag(np.array(one.spread) ** -2.0)
        total = information + own
        pull = vector + own @ np.array(one.mean)
        log_det = float(np.linalg.slogdet(total)[1])
        fit = float(pull @ np.linalg.solve(total, pull) - np.array(one.mean) @ own @ np.array(one.mean))
        score.append(math.log(one.share) - float(np.log(one.spread).sum()) + 0.5 * (fit - log_det))
        means.append(np.array(one.mean))
        covs.append(np.diag(np.array(one.spread) ** 2))
    share = np.exp(np.array(score) - max(score))
    share /= share.sum()
    mean = share @ np.array(means)
    off = np.array(means) - mean
    return mean, np.einsum("k,kij->ij", share, covs) + np.einsum("k,ki,kj->ij", share, off, off)
