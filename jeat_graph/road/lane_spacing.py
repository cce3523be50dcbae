"""How far apart lanes look through a camera: a scale across the road for whoever measured none.

Lanes of highways are 3.25 to 3.75 m wide the world over, and vehicles keep to their middles. So the places of
the tracks across the road are a comb, whose pitch tells the scale across the road to some 6 %. Where a length
across the road or surveyed points are given they tell it much better, and this is left out.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray

_TRIED_M = np.geomspace(2.0, 6.5, 120)
_LEAST_ORDER = 0.5  # length of the mean phase vector below which there is no comb
_CHANCE = 0.01  # of as good a comb, at any pitch tried, of vehicles that keep to no lanes (Rayleigh's test)
_NEAR_BEST = 0.9  # of two pitches that fit equally well the larger one is that of the lanes
_LEAST_TRACKS = 4  # of the second busiest lane


class LaneComb(NamedTuple):
    """Lanes that tracks keep to.

    Attributes:
        number: (K,) of each track's lane, counted from any.
        weight: (K,) how much each track counts, 0 where it keeps to none.
    """

    number: IntArray
    weight: FloatArray


def find_comb(x: FloatArray, weight: FloatArray) -> LaneComb | None:
    """Find the lanes that tracks keep to, or None where there are not two.

    Args:
        x: (K,) places across the road (m, of a camera whose scale may be wrong).
        weight: (K,) how much each track is believed.
    """
    if weight.sum() <= 0:
        return None
    phase = np.exp(2j * np.pi * x[:, None] / _TRIED_M)
    mean = (weight[:, None] * phase).sum(axis=0) / weight.sum()
    order = np.abs(mean)
    independent = weight.sum() ** 2 / (weight**2).sum()
    if order.max() < max(_LEAST_ORDER, np.sqrt(np.log(len(_TRIED_M) / _CHANCE) / independent)):
        return None
    best = int(np.flatnonzero(order >= _NEAR_BEST * order.max())[-1])
    # The nearest peak: the larger pitch may be on the flank of one.
    while best > 0 and order[best - 1] > order[best]:
        best -= 1
    offset = float(np.angle(mean[best])) / (2.0 * np.pi)
    place = x / _TRIED_M[best] - offset
    index = np.rint(place).astype(np.int64)
    counts = np.sort(np.bincount(index - index.min(), weights=weight > 0))
    if len(counts) < 2 or counts[-2] < _LEAST_TRACKS:
        return None
    return LaneComb(index, weight * (np.abs(place - index) < 0.3))


def comb_pitch(x: FloatArray, comb: LaneComb) -> float:
    """Distance of neighbouring lanes (m): slope of the places (K,) over the lanes' numbers; 0 without any."""
    total = float(comb.weight.sum())
    if total <= 0:
        return 0.0
    w = comb.weight / total
    lane = comb.number - float(w @ comb.number)
    spread = float((w * lane) @ lane)
    return float((w * lane) @ x / spread) if spread > 0 else 0.0
