"""How far the boxes of a detector are off: what lasts of its errors, learnt from what others say of them.

Innovations tell how well boxes repeat (`noise_learning`). An error that an object keeps for as long as it is
seen shows in none of them, but in what two sensors s and o differ by: with d of `sensor_offsets`, less its
mean, and d' that of the same track at least `lasting_after_s` before, jitter is independent and

    E[d d'] = V_s + V_o,

V the variances of what lasts (an autocovariance of differences, as Mehra's of innovations, IEEE Trans. Autom.
Control 15, 1970). Centres count twice and ln sizes half: V is the variance of one side in sizes, as ρ².

- Of three sensors or more that are compared with each other, the least squares solution without negative
  variances is the three-cornered hat (Gray and Allan, Proc. 28th Frequency Control Symposium, 1974).
- Two alone cannot say which of them is off. What their differences have beyond κ (ρ_s² + ρ_o²), which the
  states of lasting errors hold already (`singer`), is shared in proportion to 1 − P_D: the one that finds
  less is taken for the less accurate one.

An error that lasts is not averaged out by the boxes in the filter's memory, whose number n is
`lasting_boxes`. So the variance of a side of sensor s is

    r_s = max(ρ_s², ρ_c²) + n V_s,

ρ_c (`compared_std`) for sensors that are compared with others: their common frame is known no better.
S sensors.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.filters.box_sides import SIDES
from jeat_graph.filters.model_constants import ModelConstants

# To the variance of one side: of a centre (x, y) and of a ln size, which two sides of one variance have.
_TO_SIDES = np.array([2.0, 2.0, 0.5, 0.5]) / SIDES
# Sweeps of the least squares; they end on two sensors in the first one, on three after some ten.
_SWEEPS = 50
_LEAST_SHARE = 1e-12


class AccuracySums(NamedTuple):
    """What pairs of differences say.

    Attributes:
        pairs: (S, S) number of pairs of differences of one track.
        product: (S, S) sum of their products, as variances of sides.
        lasting: (S,) V of each sensor, in sizes².
    """

    pairs: FloatArray
    product: FloatArray
    lasting: FloatArray


def no_accuracy() -> AccuracySums:
    """Return the sums of no sensors."""
    return AccuracySums(np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(0))


def widened(sums: AccuracySums, lasting: float = 0.0) -> AccuracySums:
    """Return the sums with one sensor more, whose V is believed to be `lasting` until it is learnt."""
    return AccuracySums(
        np.pad(sums.pairs, (0, 1)), np.pad(sums.product, (0, 1)), np.append(sums.lasting, lasting)
    )


def count(sums: AccuracySums, sensor: int, other: int, products: FloatArray) -> AccuracySums:
    """Return the sums with the `products` (K,) of pairs of differences of two sensors."""
    pairs, product = sums.pairs.copy(), sums.product.copy()
    for row, column in ((sensor, other), (other, sensor)):
        pairs[row, column] += len(products)
        product[row, column] += products.sum()
    return sums._replace(pairs=pairs, product=product)


def products(d: FloatArray, before: FloatArray) -> FloatArray:
    """Return the products (K,), as variances of sides, of differences (K, 4) and those before them (K, 4)."""
    return np.asarray((d * before * _TO_SIDES).sum(axis=1))


def clipped(d: FloatArray, mean: FloatArray, c: ModelConstants) -> FloatArray:
    """Return differences (K, 4) less their mean (4,), no further off than a difference counts."""
    return np.asarray(np.clip(d - mean, -c.lasting_clip, c.lasting_clip))


def in_triangles(pairs: FloatArray, c: ModelConstants) -> BoolArray:
    """Return which sensors (S,) were compared enough with two others that were compared with each other."""
    known = (pairs >= c.lasting_count).astype(np.float64)
    return np.asarray(np.diagonal(known @ known @ known) > 0.0)


def solve(
    sums: AccuracySums,
    log_side_variance: FloatArray,
    p_detect: FloatArray,
    given: FloatArray,
    c: ModelConstants,
) -> FloatArray:
    """Return V (S,) of the sensors.

    Args:
        sums: of their differences.
        log_side_variance: (S,) ln ρ².
        p_detect: (S,) P_D.
        given: (S,) V as the user gives it, NaN where it is to be learnt.
        c: constants.
    """
    both = np.maximum(sums.product / (sums.pairs + c.lasting_count), 0.0)
    hat, free = in_triangles(sums.pairs, c), np.isnan(given)
    out = np.where(free, 0.0, given)
    rho2 = np.exp(log_side_variance)
    beyond = np.maximum(both - c.error_share * (rho2[:, None] + rho2[None]), 0.0)
    share = (1.0 - p_detect)[:, None] / np.maximum(2.0 - p_detect[:, None] - p_detect[None], _LEAST_SHARE)
    # Where the user says how far the other one is off, the rest is this one's.
    own = np.where(free[None], beyond * share, np.maximum(both - out[None], 0.0))
    number = sums.pairs.sum(axis=1)
    alone = free & ~hat & (number > 0.0)
    out[alone] = (sums.pairs * own).sum(axis=1)[alone] / number[alone]
    weight = sums.pairs * (hat[:, None] & hat[None])
    total = weight.sum(axis=1)
    learnt = np.flatnonzero(hat & free)
    out[learnt] = (weight * both).sum(axis=1)[learnt] / total[learnt] / 2.0
    for _ in range(_SWEEPS):
        for k in learnt:
            out[k] = max(0.0, float((weight[k] * (both[k] - out)).sum() / total[k]))
    return out


def log_noise(
    log_side_variance: FloatArray, compared: FloatArray, lasting: FloatArray, c: ModelConstants
) -> FloatArray:
    """Return ln r (S,): of ln ρ² (S,), how many pairs of boxes each was compared by (S,), and V (S,)."""
    floor = np.where(compared > c.offset_count, c.compared_std**2, 0.0)
    return np.asarray(np.log(np.maximum(np.exp(log_side_variance), floor) + c.lasting_boxes * lasting))
