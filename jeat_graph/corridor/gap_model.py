"""Two cameras with a gap between them: what one vehicle at both is like, against two different vehicles.

Of the pair of passage i at camera A and j at camera B the log ratio is

    ln [ m q_i p(v_j | v_i) p(t_j | t_i, v_i, v_j) p(lane_j | lane_i) p(length_j | length_i)
         p(class_j | class_i) ] − ln [ (1 − m q_i) β p(v_j) p(lane_j) p(length_j) p(class_j) ],

and what their appearance says, where there are embeddings (`appearance`);
m the share of A's vehicles that reach B, q_i the probability that i would pass within B's recording, β the
rate of B's vehicles that do not come from A. With z the ln of the speed less that of the traffic at this
time and lane, and μ that of the traffic,

    ln(t_j − t_i − δ) = ln D − (μ_i + μ_j)/2 − α z_i − β_v z_j + θ(t_i, lane_i) + e,
    e ~ (1 − o) N(0, s²) + o N(0, w²),   z_j = ρ z_i + e_v.

α and β_v are 1/2 where a vehicle's speed changes evenly, less where it follows others. θ is the slowness of
the gap that all vehicles share: an Ornstein–Uhlenbeck process for each lane.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr
from scipy.stats import gaussian_kde

from jeat_graph.association.appearance import AppearanceModel, centred
from jeat_graph.corridor.passages import Passages
from jeat_graph.data.arrays import FloatArray, IntArray

_LOG_2PI = math.log(2.0 * math.pi)
#: Vehicles before and after, in the lane, whose mean speed is that of the traffic.
_NEIGHBOURS = 6
#: Standard deviation of ln travel time of an outlier: a speed that is wrong, a stop.
OUTLIER_SD = 0.3
#: PassagePairs whose ln travel time is further than this from what is expected are never made.
WINDOW = 0.8
#: Least density of a feature, as a share of the greatest: what has never been seen may come.
_LEAST_DENSITY = 0.02
#: Prior of p(lane_j | lane_i) and p(class_j | class_i): that of B's vehicles, with this many counts.
_TABLE_STRENGTH = 2.0
#: Pairs whose embeddings are compared at once.
_AT_ONCE = 8192


@dataclass(frozen=True, eq=False)
class GapParameters:
    """What holds for all vehicles of a gap.

    Attributes:
        offset_s: δ, clock of B less clock of A (s).
        distance_m: D.
        weights: α and β_v of the two speeds.
        spread: s of ln travel time.
        outliers: o.
        carry: ρ.
        speed_spread: standard deviation of e_v.
        length_shift, length_spread: of ln length at B less ln length at A.
        matched: m.
        rate: β (1/s).
        lanes: p(lane_j | lane_i) over p(lane_j).
        kinds: p(class_j | class_i) over p(class_j).
        appearance: densities of the similarity of appearance; None where none are known, or none help.
    """

    offset_s: float
    distance_m: float
    weights: tuple[float, float] = (0.5, 0.5)
    spread: float = 0.06
    outliers: float = 0.03
    carry: float = 0.7
    speed_spread: float = 0.08
    length_shift: float = 0.0
    length_spread: float = 0.15
    matched: float = 0.8
    rate: float = 0.05
    lanes: FloatArray | None = None
    kinds: FloatArray | None = None
    appearance: AppearanceModel | None = None


def traffic_speed(passages: Passages) -> FloatArray:
    """Return the ln of the traffic's speed (N,) at each passage: the mean of its neighbours in its lane.

    The vehicle itself counts as one of them, so that a lone one has its own speed.
    """
    out = np.zeros(len(passages))
    for lane in np.unique(passages.lane):
        rows = np.flatnonzero(passages.lane == lane)
        sums = np.concatenate([[0.0], np.cumsum(passages.log_speed[rows])])
        at = np.arange(len(rows))
        low, high = np.maximum(at - _NEIGHBOURS, 0), np.minimum(at + _NEIGHBOURS + 1, len(rows))
        out[rows] = (sums[high] - sums[low]) / (high - low)
    return out


@dataclass(frozen=True, eq=False)
class Gap:
    """Passages of two cameras, with the traffic's speeds.

    Attributes:
        before: at A.
        after: at B.
        traffic_before: (A,) ln of the traffic's speed.
        traffic_after: (B,) the same.
        apart_variance: of ln speeds less those of the traffic at B, of vehicles that have nothing to do with
            each other; NaN takes that of those at B.
        known_appearance: what `appearance` returns, where it does not follow from these passages alone.
    """

    before: Passages
    after: Passages
    traffic_before: FloatArray
    traffic_after: FloatArray
    apart_variance: float = math.nan
    known_appearance: tuple[FloatArray, FloatArray] | None = None

    @classmethod
    def of(cls, before: Passages, after: Passages) -> Gap:
        """Put two cameras together."""
        return cls(before, after, traffic_speed(before), traffic_speed(after))

    @cached_property
    def length_density(self) -> FloatArray | None:
        """Kernel density (B,) of ln length at B, each at its own; NaN where unknown. None if none tells."""
        lengths = self.after.log_length
        known = np.isfinite(lengths)
        if not known.any() or np.ptp(lengths[known]) < 1e-6:
            return None
        out = np.full(len(lengths), np.nan)
        density = gaussian_kde(lengths[known])(lengths[known])
        out[known] = np.maximum(density, _LEAST_DENSITY * density.max())
        return out

    @cached_property
    def appearance(self) -> tuple[FloatArray, FloatArray] | None:
        """Embeddings (A, E) and (B, E) less their camera's mean, of unit length; None if a side has none."""
        if self.known_appearance is not None:
            return self.known_appearance
        before, after = self.before.appearance, self.after.appearance
        return None if before is None or after is None else (centred(before), centred(after))

    def cosines(self, pairs: PassagePairs) -> FloatArray:
        """Return the cosines (E,) of the embeddings of pairs, NaN where one has none."""
        if self.appearance is None:
            return np.full(len(pairs), np.nan)
        before, after = self.appearance
        found = [
            np.einsum("ek,ek->e", before[pairs.i[k : k + _AT_ONCE]], after[pairs.j[k : k + _AT_ONCE]])
            for k in range(0, len(pairs), _AT_ONCE)
        ]
        return np.concatenate([*found, np.zeros(0)])

    @property
    def own_before(self) -> FloatArray:
        """Return z (A,): ln speeds less those of the traffic."""
        return self.before.log_speed - self.traffic_before

    @property
    def own_after(self) -> FloatArray:
        """Return z (B,): ln speeds less those of the traffic."""
        return self.after.log_speed - self.traffic_after


@dataclass(frozen=True, eq=False)
class PassagePairs:
    """E pairs of passages that may be one vehicle.

    Attributes:
        i: (E,) at A.
        j: (E,) at B.
    """

    i: IntArray
    j: IntArray

    def __len__(self) -> int:
        """Number of pairs."""
        return len(self.i)


def candidate_pairs(gap: Gap, p: GapParameters, slowness: FloatArray, margin_s: float = 0.0) -> PassagePairs:
    """Return the pairs whose travel time may be that of one vehicle.

    Args:
        gap: both cameras.
        p: parameters.
        slowness: (A,) θ of each passage at A.
        margin_s: what may be added to either side (s): how well the clocks are known.
    """
    own, after = gap.before.log_speed, gap.after.log_speed
    fastest = np.maximum(np.maximum(own, gap.traffic_before), after.max(initial=-np.inf))
    slowest = np.minimum(np.minimum(own, gap.traffic_before), after.min(initial=np.inf))
    quick = p.distance_m * np.exp(slowness - WINDOW - fastest)
    slow = p.distance_m * np.exp(slowness + WINDOW - slowest)
    start = gap.before.t + p.offset_s
    low = np.searchsorted(gap.after.t, start + quick - margin_s)
    high = np.searchsorted(gap.after.t, start + slow + margin_s, side="right")
    count = high - low
    i = np.repeat(np.arange(len(gap.before)), count)
    j = np.arange(len(i)) - np.repeat(np.cumsum(count) - count, count) + np.repeat(low, count)
    pairs = PassagePairs(i, j)
    travel = gap.after.t[j] - start[i]
    near = travel > 0.0
    expected = expected_log_time(gap, PassagePairs(i[near], j[near]), p, slowness)
    near[near] = np.abs(np.log(travel[near]) - expected) < WINDOW
    return PassagePairs(pairs.i[near], pairs.j[near])


def expected_log_time(gap: Gap, pairs: PassagePairs, p: GapParameters, slowness: FloatArray) -> FloatArray:
    """Return the ln of the travel time (E,) that each pair would take (s)."""
    i, j = pairs.i, pairs.j
    return np.asarray(
        math.log(p.distance_m)
        - 0.5 * (gap.traffic_before[i] + gap.traffic_after[j])
        - p.weights[0] * gap.own_before[i]
        - p.weights[1] * gap.own_after[j]
        + slowness[i]
    )


def _residual_variance(gap: Gap, pairs: PassagePairs, p: GapParameters, travel: FloatArray) -> FloatArray:
    """Return the variance (E,) of e of no outlier: s² and what the errors of times and speeds add."""
    i, j = pairs.i, pairs.j
    times = (gap.before.sigma_t[i] ** 2 + gap.after.sigma_t[j] ** 2) / travel**2
    speeds = (p.weights[0] * gap.before.sigma_speed[i]) ** 2 + (p.weights[1] * gap.after.sigma_speed[j]) ** 2
    return np.asarray(p.spread**2 + times + speeds)


class PairTimes(NamedTuple):
    """What the times of E pairs say.

    Attributes:
        travel: (E,) travel times (s).
        error: (E,) e.
        variance: (E,) of e of no outlier.
        inlier: (E,) ln of that part of the density of e that goes with the traffic.
        outlier: (E,) ln of the other part.
    """

    travel: FloatArray
    error: FloatArray
    variance: FloatArray
    inlier: FloatArray
    outlier: FloatArray

    def of_traffic(self, probability: FloatArray | float) -> FloatArray:
        """Return the part of the pairs' probability (E,) that goes with the traffic, and is no outlier."""
        return np.asarray(probability / (1.0 + np.exp(np.clip(self.outlier - self.inlier, -50.0, 50.0))))


def pair_times(gap: Gap, pairs: PassagePairs, p: GapParameters, slowness: FloatArray) -> PairTimes:
    """Return travel times, residuals and both parts of their density; travel times are positive."""
    travel = gap.after.t[pairs.j] - gap.before.t[pairs.i] - p.offset_s
    error = np.asarray(np.log(travel) - expected_log_time(gap, pairs, p, slowness))
    variance = _residual_variance(gap, pairs, p, travel)
    inlier = _log_normal(error, variance) + math.log1p(-p.outliers)
    outlier = _log_normal(error, np.full(len(error), OUTLIER_SD**2)) + math.log(p.outliers)
    return PairTimes(travel, error, variance, inlier, outlier)


def log_ratios(
    gap: Gap, pairs: PassagePairs, p: GapParameters, slowness: FloatArray, times: PairTimes
) -> FloatArray:
    """Return the log ratio (E,) of "one vehicle" to "both alone" of each pair; `times` are of the same."""
    i, j = pairs.i, pairs.j
    reach = p.matched * within(gap, p, slowness)[i]
    out = np.logaddexp(times.inlier, times.outlier) - np.log(times.travel)
    out += np.log(reach) - np.log1p(-reach) - math.log(p.rate)
    out += _speed_ratio(gap, pairs, p) + _length_ratio(gap, pairs, p)
    out += _table_ratio(gap.before.lane[i], gap.after.lane[j], p.lanes)
    out += _table_ratio(gap.before.kind[i], gap.after.kind[j], p.kinds)
    if p.appearance is not None:
        out += p.appearance.log_ratio(gap.cosines(pairs))
    return np.asarray(out)


def within(gap: Gap, p: GapParameters, slowness: FloatArray) -> FloatArray:
    """Return how probable it is (A,) that each passage at A would pass B while B was recorded."""
    travel = p.distance_m * np.exp(slowness - gap.before.log_speed)
    arrival = gap.before.t + p.offset_s + travel
    sd = 0.15 * travel + 0.1
    start, end = gap.after.span_s
    return np.clip(ndtr((end - arrival) / sd) - ndtr((start - arrival) / sd), 1e-3, 1.0 - 1e-3)


def _speed_ratio(gap: Gap, pairs: PassagePairs, p: GapParameters) -> FloatArray:
    """Return ln p(z_j | z_i) / p(z_j); p(z_j) is normal."""
    z_i, z_j = gap.own_before[pairs.i], gap.own_after[pairs.j]
    error = gap.after.sigma_speed[pairs.j] ** 2 + (p.carry * gap.before.sigma_speed[pairs.i]) ** 2
    joined = _log_normal(z_j - p.carry * z_i, p.speed_spread**2 + error)
    variance = gap.apart_variance
    if math.isnan(variance):
        variance = max(float(gap.own_after.var()), 1e-6)
    apart = _log_normal(z_j, np.full(len(z_j), variance))
    return np.asarray(joined - apart)


def _length_ratio(gap: Gap, pairs: PassagePairs, p: GapParameters) -> FloatArray:
    """Return ln p(length_j | length_i) / p(length_j), 0 where unknown; p(length_j) is a kernel density."""
    i, j = pairs.i, pairs.j
    lengths, apart = gap.after.log_length, gap.length_density
    out = np.zeros(len(pairs))
    both = np.isfinite(gap.before.log_length[i]) & np.isfinite(lengths[j])
    if apart is None or not both.any():
        return out
    i, j = i[both], j[both]
    error = gap.before.sigma_length[i] ** 2 + gap.after.sigma_length[j] ** 2
    joined = _log_normal(lengths[j] - gap.before.log_length[i] - p.length_shift, p.length_spread**2 + error)
    floor = math.log(_LEAST_DENSITY) + np.log(np.nanmax(apart))
    out[both] = np.logaddexp(joined, floor) - np.log(apart[j])
    return out


def _table_ratio(before: IntArray, after: IntArray, table: FloatArray | None) -> FloatArray:
    """Return ln of the table's entry (E,), 0 where either is unknown."""
    if table is None:
        return np.zeros(len(before))
    both = (before >= 0) & (after >= 0)
    out = np.zeros(len(before))
    out[both] = np.log(table[before[both], after[both]])
    return out


def table_of(
    before: IntArray, after: IntArray, weight: FloatArray, shape: tuple[int, int], seen: IntArray
) -> FloatArray | None:
    """Return p(b | a) / p(b) of a feature with names, from weighed pairs.

    Args:
        before: (E,) places at A, −1 unknown.
        after: (E,) places at B, −1 unknown.
        weight: (E,) probabilities of the pairs.
        shape: numbers of names at A and B.
        seen: (B,) places of all passages at B.
    """
    if not min(shape):
        return None
    both = (before >= 0) & (after >= 0)
    counts = np.zeros(shape)
    np.add.at(counts, (before[both], after[both]), weight[both])
    base = np.bincount(seen[seen >= 0], minlength=shape[1]) + 0.5
    base = base / base.sum()
    joint = counts + _TABLE_STRENGTH * base
    return np.asarray(joint / joint.sum(axis=1, keepdims=True) / base)


def _log_normal(x: FloatArray, variance: FloatArray) -> FloatArray:
    return np.asarray(-0.5 * (x * x / variance + np.log(variance) + _LOG_2PI))
