"""Hands vehicles over from one camera to the next along a corridor, and refuses what traffic cannot tell."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from jeat_graph.association.matching_marginals import best_matching
from jeat_graph.corridor.clock_search import Peak, find_offset
from jeat_graph.corridor.gap_fit import FittedGap, Prior, fit_gap
from jeat_graph.corridor.gap_model import Gap
from jeat_graph.corridor.passages import Passages
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError

#: Fewer vehicles do not tell what holds for all.
LEAST_VEHICLES = 40
#: A peak of the clock's votes must stand out by so many robust standard deviations, and be so many times as
#: high as the next: 4.1 to 6.0 and 1.0 to 1.6 times were seen between roads that have nothing in common.
LEAST_HEIGHT, LEAST_RATIO = 5.5, 1.75
#: Clocks are looked for within this (s) if nothing is known of them.
CLOCK_WITHIN_S = 600.0
#: Distances that are tried where none is known (m), each so many times the one before.
_DISTANCES_M, _DISTANCE_STEP = (30.0, 6000.0), 1.03
#: Standard deviations of a known clock within which it is looked for.
_CLOCK_SIGMAS = 4.0


@dataclass(frozen=True)
class KnownGap:
    """What is declared of a gap.

    Attributes:
        first, second: names of the cameras.
        distance_m, distance_sd_m: from line to line; NaN where it is not known.
        offset_s, offset_sd_s: clock of the second less that of the first; NaN where it is not known.
    """

    first: str
    second: str
    distance_m: float = math.nan
    distance_sd_m: float = math.nan
    offset_s: float = math.nan
    offset_sd_s: float = math.nan


@dataclass(frozen=True, eq=False)
class Handover:
    """One gap, solved.

    Attributes:
        known: what was declared of it.
        fitted: the gap and the probabilities of all pairs.
        peak: of the search for the clock.
        first, second: (P,) rows of the vehicles that are handed over, at both cameras.
        probability: (P,) of each.
    """

    known: KnownGap
    fitted: FittedGap
    peak: Peak
    first: IntArray
    second: IntArray
    probability: FloatArray


def chain(gaps: Sequence[KnownGap], cameras: Sequence[str]) -> list[str]:
    """Return the cameras in the order in which traffic passes them.

    Raises:
        DataError: a gap names a camera that is not there, or the gaps are not one chain over all cameras.
    """
    for gap in gaps:
        for name in (gap.first, gap.second):
            if name not in cameras:
                raise DataError(
                    f"{gap.first}-{gap.second}: there is no camera {name!r}: {', '.join(cameras)}"
                )
    following = {gap.first: gap.second for gap in gaps}
    starts = [name for name in cameras if name not in following.values()]
    order = starts[:1]
    while order and order[-1] in following and len(order) <= len(cameras):
        order.append(following[order[-1]])
    if len(following) != len(gaps) or len(order) != len(cameras) or len(gaps) != len(cameras) - 1:
        raise DataError(
            "the gaps must lead from one camera to the next, once through all of them: for cameras "
            f"{', '.join(cameras)} give {len(cameras) - 1} gaps, as --distance A-B=500±5 --distance B-C=800±5"
        )
    return order


def hand_over(gaps: Sequence[KnownGap], cameras: Mapping[str, Passages]) -> list[Handover]:
    """Solve all gaps.

    Args:
        gaps: in the order of the corridor.
        cameras: passages by name.

    Raises:
        DataError: too few vehicles, or a clock or a distance that the traffic does not tell.
    """
    for name, passages in cameras.items():
        if len(passages) < LEAST_VEHICLES:
            raise DataError(
                f"camera {name}: {len(passages)} vehicles pass its line; fewer than {LEAST_VEHICLES} do not "
                "tell how long the way takes"
            )
    return [solve(gap, Gap.of(cameras[gap.first], cameras[gap.second])) for gap in gaps]


def solve(known: KnownGap, gap: Gap) -> Handover:
    """Find the clock, fit the gap, and choose who is handed over.

    Those pairs of the matching with the greatest sum of probabilities are made for which the expected F1 of
    all that are made is greatest.

    Raises:
        DataError: the traffic does not tell the clock, or neither clock nor distance is known.
    """
    name = f"{known.first}-{known.second}"
    distance, peak = _distance_and_clock(known, gap)
    if math.isnan(known.distance_m):
        prior = Prior(distance, 0.5 * distance, known.offset_s, known.offset_sd_s)
    elif math.isnan(known.offset_s):
        prior = Prior(distance, known.distance_sd_m)
    else:
        prior = Prior(distance, known.distance_sd_m, known.offset_s, known.offset_sd_s)
    fitted = fit_gap(gap, prior, peak.offset_s)
    pairs, probability = fitted.pairs, fitted.marginals.pair
    made = best_matching(pairs.i, pairs.j, probability, len(gap.before), len(gap.after))
    rows = np.flatnonzero(made)
    rows = rows[np.argsort(-probability[rows], kind="stable")]
    expected = 2.0 * np.cumsum(probability[rows]) / (np.arange(1, len(rows) + 1) + probability.sum())
    rows = rows[: int(np.argmax(expected)) + 1] if len(rows) else rows
    if len(rows) < LEAST_VEHICLES // 4:
        raise DataError(
            f"{name}: {len(rows)} vehicles are followed from one camera to the other: too few to say anything"
        )
    rows = rows[np.argsort(pairs.i[rows], kind="stable")]
    return Handover(known, fitted, peak, pairs.i[rows], pairs.j[rows], probability[rows])


def _distance_and_clock(known: KnownGap, gap: Gap) -> tuple[float, Peak]:
    """Distance (m) and offset to begin with."""
    name = f"{known.first}-{known.second}"
    if math.isnan(known.offset_s):
        if math.isnan(known.distance_m):
            raise DataError(
                f"{name}: neither its distance nor its clocks are known, and in traffic one passes for the "
                f"other: give --distance {name}=METRES±METRES or --clock {name}=SECONDS±SECONDS"
            )
        within = (-CLOCK_WITHIN_S, CLOCK_WITHIN_S)
        (start, end), (other_start, other_end) = gap.before.span_s, gap.after.span_s
        if other_start > end + CLOCK_WITHIN_S or start > other_end + CLOCK_WITHIN_S:
            # By these clocks they show different hours: the starts are taken for about one time.
            within = (within[0] + other_start - start, within[1] + other_start - start)
    else:
        reach = _CLOCK_SIGMAS * known.offset_sd_s
        within = (known.offset_s - reach, known.offset_s + reach)
    if math.isnan(known.distance_m):
        count = int(math.log(_DISTANCES_M[1] / _DISTANCES_M[0]) / math.log(_DISTANCE_STEP))
        tried = [_DISTANCES_M[0] * _DISTANCE_STEP**k for k in range(count + 1)]
        found = [(find_offset(gap, distance, within), distance) for distance in tried]
        peak, distance = max(found, key=lambda one: one[0].height)
    else:
        distance = known.distance_m
        peak = find_offset(gap, distance, within)
    alone = peak.height < LEAST_RATIO * peak.runner_up
    if peak.height < LEAST_HEIGHT or (math.isnan(known.offset_s) and alone):
        what = "its clock" if math.isnan(known.offset_s) else "vehicles in common"
        raise DataError(
            f"{name}: traffic does not show {what}: the best offset stands out by {peak.height:.1f} "
            f"robust deviations, the next by {peak.runner_up:.1f} ({LEAST_HEIGHT:g} are needed, and "
            f"{LEAST_RATIO:g} times the next). Is the distance right, and do both show the same time?"
        )
    return distance, peak


def identities_of(
    order: Sequence[str], handovers: Sequence[Handover], cameras: Mapping[str, Passages]
) -> dict[str, IntArray]:
    """Number the vehicles of the corridor: (N,) identities of each camera's passages, from 1 on."""
    found: dict[str, IntArray] = {}
    total = 0
    for place, name in enumerate(order):
        own = np.zeros(len(cameras[name]), dtype=np.int64)
        if place:
            over = handovers[place - 1]
            own[over.second] = found[order[place - 1]][over.first]
        new = np.flatnonzero(own == 0)
        own[new] = total + 1 + np.arange(len(new))
        total += len(new)
        found[name] = own
    return found
