"""Fits a gap to the passages of its two cameras: expectation–maximisation over who is who.

Each round takes the probabilities of all pairs (`matching_marginals`) and estimates what holds for all
vehicles (`GapParameters`) and the slowness that they share, each the more of a pair the more probable it is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from jeat_graph.association.appearance import learn_appearance
from jeat_graph.association.matching_marginals import MatchingMarginals, matching_marginals
from jeat_graph.corridor.gap_model import (
    Gap,
    GapParameters,
    PairTimes,
    PassagePairs,
    candidate_pairs,
    log_ratios,
    pair_times,
    table_of,
    within,
)
from jeat_graph.corridor.shared_slowness import Slowness, by_lane, pooled
from jeat_graph.data.arrays import FloatArray

_ROUNDS = 40
#: What vehicles look like is learnt so many times, each with better times of the gap.
_APPEARANCE_ROUNDS = 2
_TOLERANCE = 1e-4
#: Priors, each a mean with its standard deviation: of the speeds' weights, and of the mean slowness, which
#: holds the errors of both cameras' scales too.
_WEIGHT, _WEIGHT_SD = 0.5, 0.15
SLOWNESS_SD = 0.02
#: Counts of a Beta prior: of outliers, of vehicles that reach the second camera.
_OUTLIERS = (1.0, 30.0)
_MATCHED = (2.0, 1.0)
#: Prior of the spreads: this many pairs that have them, and the least value.
_SPREAD_COUNT = 5.0
_LEAST_SPREAD = 0.004
_BOUNDS_OUTLIERS = (0.002, 0.3)
_BOUNDS_MATCHED = (0.05, 0.995)
_CARRY_COUNT = 2.0


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known of a gap before its traffic is seen.

    Attributes:
        distance_m, distance_sd_m: from line to line.
        offset_s, offset_sd_s: clock of B less clock of A; the deviation is infinite where it is not known.
    """

    distance_m: float
    distance_sd_m: float
    offset_s: float = 0.0
    offset_sd_s: float = math.inf


@dataclass(frozen=True, eq=False)
class FittedGap:
    """A gap with the probabilities of its pairs.

    Attributes:
        gap: the cameras.
        parameters: what holds for all vehicles.
        slowness: (A,) θ of each passage at A.
        shared: what of it all lanes share.
        pairs: E pairs.
        marginals: their probabilities.
        log_ratio: (E,) ln of "one vehicle" over "both alone".
        covariance: (2, 2) of offset (s) and distance (m).
    """

    gap: Gap
    parameters: GapParameters
    slowness: FloatArray
    shared: Slowness
    pairs: PassagePairs
    marginals: MatchingMarginals
    log_ratio: FloatArray
    covariance: FloatArray


def fit_gap(gap: Gap, prior: Prior, offset_s: float, rounds: int = _ROUNDS) -> FittedGap:
    """Fit a gap.

    Args:
        gap: the cameras.
        prior: what is known.
        offset_s: where to begin with the clock.
        rounds: at most so many, and as many again each time that appearance is learnt.
    """
    a, b = len(gap.before), len(gap.after)
    span = max(gap.after.span_s[1] - gap.after.span_s[0], 1.0)
    p = GapParameters(offset_s, prior.distance_m, rate=max(0.3 * b, 1.0) / span)
    slowness, shared = np.zeros(a), Slowness(np.zeros(a), 0.0, 60.0)
    covariance = np.zeros((2, 2))
    done, learnt = rounds, 0
    for k in range((1 + _APPEARANCE_ROUNDS) * rounds):
        pairs = candidate_pairs(gap, p, slowness)
        times = pair_times(gap, pairs, p, slowness)
        ratio = log_ratios(gap, pairs, p, slowness, times)
        marginals = matching_marginals(pairs.i, pairs.j, ratio, a, b)
        old = p
        p, slowness, shared, covariance = _improved(gap, pairs, marginals.pair, p, slowness, times, prior)
        if _change(old, p) < _TOLERANCE or k + 1 == done:
            if gap.appearance is None or learnt == _APPEARANCE_ROUNDS:
                break
            # By matches that times, lanes and lengths decide alone; again when these are known better.
            cosine = gap.cosines(pairs)
            if p.appearance is not None:
                marginals = matching_marginals(pairs.i, pairs.j, ratio - p.appearance.log_ratio(cosine), a, b)
            p, learnt, done = (
                replace(p, appearance=learn_appearance(cosine, marginals.pair)),
                learnt + 1,
                k + 1 + rounds,
            )
            if p.appearance is None:
                break
    pairs = candidate_pairs(gap, p, slowness)
    ratio = log_ratios(gap, pairs, p, slowness, pair_times(gap, pairs, p, slowness))
    marginals = matching_marginals(pairs.i, pairs.j, ratio, a, b)
    return FittedGap(gap, p, slowness, shared, pairs, marginals, ratio, covariance)


def _change(old: GapParameters, new: GapParameters) -> float:
    """How far the parameters moved, in units in which 1 is a great step."""
    return max(
        abs(math.log(new.spread / old.spread)),
        abs(new.matched - old.matched),
        abs(new.offset_s - old.offset_s) / 10.0,
        abs(new.carry - old.carry),
    )


def _improved(
    gap: Gap,
    pairs: PassagePairs,
    probability: FloatArray,
    p: GapParameters,
    slowness: FloatArray,
    times: PairTimes,
    prior: Prior,
) -> tuple[GapParameters, FloatArray, Slowness, FloatArray]:
    """Return the next parameters, the slowness of each passage, what is shared of it, and the covariance."""
    share = times.of_traffic(probability)
    total = float(probability.sum())
    p, mean_slowness, covariance = _clock_and_weights(gap, pairs, share, p, slowness, times, prior)
    level = np.full(len(gap.before), mean_slowness)
    times = pair_times(gap, pairs, p, level)
    value, noise = pooled(pairs.i, times.error, times.variance, share, len(gap.before))
    varying, shared = by_lane(gap.before.t, gap.before.lane, value, noise)
    slowness = level + varying
    p = replace(
        p,
        spread=_spread(times.error - varying[pairs.i], times.variance - p.spread**2, share, p.spread),
        outliers=_beta(float((probability - share).sum()), total, _OUTLIERS, _BOUNDS_OUTLIERS),
    )
    return _features(gap, pairs, probability, p, slowness), slowness, shared, covariance


def _clock_and_weights(
    gap: Gap,
    pairs: PassagePairs,
    share: FloatArray,
    p: GapParameters,
    slowness: FloatArray,
    times: PairTimes,
    prior: Prior,
) -> tuple[GapParameters, float, FloatArray]:
    """Weighed least squares in the offset, the distance, the weights of the speeds, and the mean slowness.

    Returns:
        Parameters with these; the mean slowness; the covariance (2, 2) of offset and distance.
    """
    i, j = pairs.i, pairs.j
    mean = float(np.average(slowness, weights=np.bincount(i, share, len(slowness)) + 1e-9))
    travel, e = times.travel, times.error
    # The same for all: that fast vehicles arrive earlier by less than their speeds say is mostly the error of
    # these speeds, and would pass for an offset.
    level = np.full(len(e), -float(np.average(1.0 / travel, weights=share + 1e-12)) if len(e) else 0.0)
    jacobian = np.stack(
        [level, np.full(len(e), -1.0 / p.distance_m), gap.own_before[i], gap.own_after[j], -np.ones(len(e))],
        axis=1,
    )
    weight = share / times.variance
    precision = np.array(
        [prior.offset_sd_s**-2, prior.distance_sd_m**-2, _WEIGHT_SD**-2, _WEIGHT_SD**-2, SLOWNESS_SD**-2]
    )
    off = np.array(
        [p.offset_s - prior.offset_s, p.distance_m - prior.distance_m, p.weights[0] - _WEIGHT,
         p.weights[1] - _WEIGHT, mean]
    )  # fmt: skip
    hessian = jacobian.T @ (weight[:, None] * jacobian) + np.diag(precision)
    step = -np.linalg.solve(hessian, jacobian.T @ (weight * e) + precision * off)
    covariance = np.asarray(np.linalg.inv(hessian), dtype=np.float64)[:2, :2]
    # A step of the offset is no longer than what keeps travel times positive.
    step[0] = np.clip(
        step[0], -0.5 * float(travel.min(initial=np.inf)), 0.5 * float(travel.min(initial=np.inf))
    )
    new = replace(
        p,
        offset_s=p.offset_s + step[0],
        distance_m=p.distance_m + step[1],
        weights=(p.weights[0] + step[2], p.weights[1] + step[3]),
    )
    return new, mean + float(step[4]), covariance


def _features(
    gap: Gap, pairs: PassagePairs, probability: FloatArray, p: GapParameters, slowness: FloatArray
) -> GapParameters:
    """Return the parameters with what the pairs say of speeds, lengths, lanes, classes and rates."""
    i, j, total = pairs.i, pairs.j, float(probability.sum())
    z_i, z_j = gap.own_before[i], gap.own_after[j]
    scale = max(float(gap.own_before.var()), 1e-6)
    carry = float((probability * z_i * z_j).sum() + _CARRY_COUNT * 0.7 * scale)
    carry /= float((probability * z_i * z_i).sum() + _CARRY_COUNT * scale)
    carry = float(np.clip(carry, 0.0, 1.2))
    errors = gap.after.sigma_speed[j] ** 2 + (carry * gap.before.sigma_speed[i]) ** 2
    lengths = gap.after.log_length[j] - gap.before.log_length[i]
    known = np.isfinite(lengths)
    shift, length_spread = p.length_shift, p.length_spread
    if known.any():
        weight = probability[known]
        shift = float((weight * lengths[known]).sum() / (weight.sum() + _SPREAD_COUNT))
        own = gap.before.sigma_length[i][known] ** 2 + gap.after.sigma_length[j][known] ** 2
        length_spread = _spread(lengths[known] - shift, own, weight, 0.1)
    reach = float(within(gap, p, slowness).sum())
    span = max(gap.after.span_s[1] - gap.after.span_s[0], 1.0)
    shapes = (
        (len(gap.before.lanes), len(gap.after.lanes)),
        (len(gap.before.kinds), len(gap.after.kinds)),
    )
    return replace(
        p,
        carry=carry,
        speed_spread=_spread(z_j - carry * z_i, errors, probability, 0.05),
        length_shift=shift,
        length_spread=length_spread,
        matched=_beta(total, reach, _MATCHED, _BOUNDS_MATCHED),
        rate=max(len(gap.after) - total, 1.0) / span,
        lanes=table_of(gap.before.lane[i], gap.after.lane[j], probability, shapes[0], gap.after.lane),
        kinds=table_of(gap.before.kind[i], gap.after.kind[j], probability, shapes[1], gap.after.kind),
    )


def _spread(error: FloatArray, known: FloatArray, weight: FloatArray, before: float) -> float:
    """Standard deviation of what errors (E,) have besides their known variances (E,)."""
    squares = float((weight * (error**2 - known)).sum()) + _SPREAD_COUNT * before**2
    return math.sqrt(max(squares / (float(weight.sum()) + _SPREAD_COUNT), _LEAST_SPREAD**2))


def _beta(count: float, of: float, prior: tuple[float, float], bounds: tuple[float, float]) -> float:
    """Posterior mean of a share."""
    return float(np.clip((count + prior[0]) / (of + sum(prior)), *bounds))
