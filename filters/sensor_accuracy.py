"""How far the boxes of a detector are off: what lasts of its errors, learnt from what others say of them.

Innovations tell how well boxes repeat (`noise_learning`). An error that an object keeps for as long as it is
seen shows in none of them, but in what two sensors s and o differ by: with d of `sensor_offsets`, less its
mean, and d' that of the same track at least `lasting_after_s` before, jitter is independent and

    E[d d'] = V_s + V_o,

V the variances of what lasts (an autocovariance of differences, as Mehra's of innovations, IEEE Trans. Autom.
Control 15, 1970). Centres count twice and ln sizes half: V is the variance of one side in sizes, as ρ².

- Of three sensors or more that are compared with each other, the least squares solution without negative
  variances is the three-cornered hat (Gray and Allan, Proc. 28th Frequency Control Symposium, 1974).
- Of two alone, what their differences have beyond κ (ρ_s² + ρ_o²), which the states of lasting errors hold
  already (`singer`), is shared. Whose error it is shows in what it correlates with: with a = ln(w/h) the sum
  u = a_s + a_o is twice what is true and both errors, their difference e = a_s − a_o the errors alone, so

      E[(u − ū)' e] = V_s − V_o,    E[e e'] = V_s + V_o

  if errors do not depend on what is true (Grubbs, "On estimating precision of measuring instruments and
  product variability", J. Am. Stat. Assoc. 43, 1948). Before that is known, 1 − P_D shares it: the one that
  finds less is taken for the less accurate one.

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
# Sums of `AccuracySums.aspect`: of u, u², e, e² over both times of a pair, of e e', and of (e u' + e' u) / 2.
SUM, SUM_SQUARE, DIFFERENCE, DIFFERENCE_SQUARE, LASTING, LEANING = range(6)
# What is the same seen from the other sensor, and what has the other sign.
_SIGN = np.array([1.0, 1.0, -1.0, 1.0, 1.0, -1.0])
_ASPECT_SUMS = len(_SIGN)
# Sweeps of the least squares; they end on two sensors in the first one, on three after some ten.
_SWEEPS = 50
_LEAST_SHARE = 1e-12


class AccuracySums(NamedTuple):
    """What pairs of differences say.

    Attributes:
        pairs: (S, S) number of pairs of differences of one track.
        product: (S, S) sum of their products, as variances of sides.
        aspect: (S, S, 6) sums over aspects of both sensors, row less column.
        lasting: (S,) V of each sensor, in sizes².
    """

    pairs: FloatArray
    product: FloatArray
    aspect: FloatArray
    lasting: FloatArray


def no_accuracy() -> AccuracySums:
    """Return the sums of no sensors."""
    return AccuracySums(np.zeros((0, 0)), np.zeros((0, 0)), np.zeros((0, 0, _ASPECT_SUMS)), np.zeros(0))


def widened(sums: AccuracySums, lasting: float = 0.0) -> AccuracySums:
    """Return the sums with one sensor more, whose V is believed to be `lasting` until it is learnt."""
    return AccuracySums(
        np.pad(sums.pairs, (0, 1)),
        np.pad(sums.product, (0, 1)),
        np.pad(sums.aspect, ((0, 1), (0, 1), (0, 0))),
        np.append(sums.lasting, lasting),
    )


def count(sums: AccuracySums, sensor: int, other: int, now: FloatArray, before: FloatArray) -> AccuracySums:
    """Return the sums with how two sensors compare on K tracks, `now` and `before` (K, 5).

    Args:
        sums: so far.
        sensor: who was compared.
        other: with whom.
        now: differences of `clipped` (4) and the sum of both aspects of `aspect_sum`.
        before: the same of the same track, `lasting_after_s` or more before.
    """
    pairs, product, aspect = sums.pairs.copy(), sums.product.copy(), sums.aspect.copy()
    d, before_d, u, before_u = now[:, :-1], before[:, :-1], now[:, -1], before[:, -1]
    e, before_e = d[:, 2] - d[:, 3], before_d[:, 2] - before_d[:, 3]
    of_pairs = float(products(d, before_d).sum())
    new = np.array(
        [
            (u + before_u).sum(),
            (u**2 + before_u**2).sum(),
            (e + before_e).sum(),
            (e**2 + before_e**2).sum(),
            (e * before_e).sum(),
            (e * before_u + before_e * u).sum() / 2.0,
        ]
    )
    for row, column, sign in ((sensor, other, 1.0), (other, sensor, _SIGN)):
        pairs[row, column] += len(now)
        product[row, column] += of_pairs
        aspect[row, column] += sign * new
    return sums._replace(pairs=pairs, product=product, aspect=aspect)


def products(d: FloatArray, before: FloatArray) -> FloatArray:
    """Return the products (K,), as variances of sides, of differences (K, 4) and those before them (K, 4)."""
    return np.asarray((d * before * _TO_SIDES).sum(axis=1))


def aspect_sum(boxes: FloatArray, others: FloatArray, c: ModelConstants) -> FloatArray:
    """Return u (K,) of boxes and others (K, 4: left, top, right, bottom)."""
    size, other_size = boxes[:, 2:] - boxes[:, :2], others[:, 2:] - others[:, :2]
    u = np.log(size[:, 0] / size[:, 1]) + np.log(other_size[:, 0] / other_size[:, 1])
    return np.asarray(np.clip(u, -c.aspect_clip, c.aspect_clip))


def shares(sums: AccuracySums, p_detect: FloatArray, c: ModelConstants) -> FloatArray:
    """Return which share (S, S) of what lasts between two sensors is the row's.

    δ = (V_s − V_o)/(V_s + V_o) has a normal prior about what P_D says, with the standard deviation
    `aspect_prior`. What is measured of it has the variance Var u Var e / (n E[e e']²), n the pairs over
    `aspect_pairs`, for an aspect changes more slowly than pairs follow each other.
    """
    number = np.maximum(sums.pairs, 1.0)
    u, e = sums.aspect[..., SUM] / number / 2.0, sums.aspect[..., DIFFERENCE] / number / 2.0
    var_u = sums.aspect[..., SUM_SQUARE] / number / 2.0 - u**2
    var_e = sums.aspect[..., DIFFERENCE_SQUARE] / number / 2.0 - e**2
    lasting = np.maximum(sums.aspect[..., LASTING] / number - e**2, 0.0)
    leaning = sums.aspect[..., LEANING] / number - e * u
    missed = 1.0 - p_detect
    prior = (missed[:, None] - missed) / np.maximum(missed[:, None] + missed, _LEAST_SHARE)
    per_square = sums.pairs / c.aspect_pairs / np.maximum(var_u * var_e, _LEAST_SHARE)
    precise = 1.0 / c.aspect_prior**2
    delta = (prior * precise + per_square * lasting * leaning) / (precise + per_square * lasting**2)
    return np.asarray(0.5 + 0.5 * np.clip(delta, -1.0, 1.0))


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
    # Where the user says how far the other one is off, the rest is this one's.
    own = np.where(free[None], beyond * shares(sums, p_detect, c), np.maximum(both - out[None], 0.0))
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
