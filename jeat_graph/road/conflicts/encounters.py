"""Encounters of vehicles on the road, and which of them are conflicts beyond reasonable doubt.

What is not known of two vehicles (place, speed, heading, size) is drawn, the same errors every time; each
measure is computed of each draw. Its interval is that of the draws, and the probability of a conflict is the
share of the draws that are beyond a threshold.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jeat_graph.config.fields import check, number
from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.normal import Z95
from jeat_graph.road.conflicts.measures import Collision, arrivals, collision, encroachment, separation
from jeat_graph.road.conflicts.poses import HEADING, LENGTH, SPEED, WIDTH, Poses

REAR_END, CROSSING, HEAD_ON = "rear-end", "crossing", "head-on"
_STEP_S, _COARSE_S = 0.05, 0.15
#: So many draws tell whether a pair may be a conflict at all, and so many measure it then: of fewer the ends
#: of a 95 % interval are too near by a fifth in some directions of the errors.
_FEW, _MANY = 160, 1024
#: A time to collision is looked for this long before and after its least (s).
_AROUND_S = 1.0
#: The fine grid of post-encroachment times: this wide to either side (s), and this many steps.
_FINE_S, _FINE = 0.4, 14
#: An estimate below or above all draws counts as one below or above all but this share of them.
_LEAST_SHARE = 0.005
#: How far beyond its estimate a vehicle may be (standard deviations), to be looked at.
_BEYOND = 3.0


@dataclass(frozen=True)
class ConflictConfig:
    """What counts as a conflict.

    TTC of 1.5 s is Hayward's and the default of the FHWA's SSAM; 3.35 m/s² is Archer's (2005); a PET of 1 s
    is that of serious conflicts. Among vehicles that follow one another a short time gap is a headway, so the
    PET is judged where paths cross.
    """

    ttc_s: float = number(1.5, "s", "time to collision below which it is a conflict", open_low=True)
    drac: float = number(3.35, "m/s²", "deceleration to avoid a crash above which it is", open_low=True)
    pet_s: float = number(1.0, "s", "post-encroachment time below which it is, where paths cross")
    most_doubt: float = number(0.05, "1", "probability that it is none, at most", high=1.0)
    longest_s: float = number(5.0, "s", "those farther apart in time do not meet", open_low=True)
    following_deg: float = number(30.0, "degrees", "paths at a smaller angle follow or meet", high=90.0)

    def __post_init__(self) -> None:
        check(self)


class Measured(NamedTuple):
    """A measure with its 95 % interval; NaN or infinite where there is none.

    Attributes:
        value: the estimate.
        low: lower end.
        high: upper end.
    """

    value: float
    low: float
    high: float


NOTHING = Measured(math.nan, math.nan, math.nan)


class Meeting(NamedTuple):
    """Two vehicles at a place that both come to.

    Attributes:
        first: who is there first.
        second: who comes later.
        t_first: about when the first is there (s).
        t_second: about when the second is (s).
    """

    first: Poses
    second: Poses
    t_first: float
    t_second: float


class Encounter(NamedTuple):
    """Two vehicles that come close.

    Attributes:
        first: identity of the one that is ahead, or first at the place where paths cross.
        second: of the other.
        first_kind: class of the first.
        second_kind: class of the second.
        kind: `rear-end`, `crossing` or `head-on`.
        t: when the time to collision is least; without one, when the second takes the first's place (s).
        x: where the second is then, across the road (m).
        y: along it (m).
        ttc: least time to collision (s).
        drac: deceleration that avoids the crash, its most (m/s²).
        pet: post-encroachment time (s).
        headway: from front to front at one place, of those that follow (s).
        probability: that it is a conflict by one of the thresholds.
    """

    first: int
    second: int
    first_kind: str
    second_kind: str
    kind: str
    t: float
    x: float
    y: float
    ttc: Measured
    drac: Measured
    pet: Measured
    headway: Measured
    probability: float


@functools.cache
def _errors(draws: int) -> FloatArray:
    """Standard normal errors (1 + draws, 12) of two vehicles; the first draw is without."""
    from scipy.special import ndtri
    from scipy.stats import qmc

    z = ndtri(qmc.Halton(12, scramble=True, rng=0).random(draws // 2))
    return np.concatenate([np.zeros((1, 12)), z, -z])


def encounters(
    vehicles: Sequence[Poses],
    config: ConflictConfig,
    progress: Callable[[int, int], None] | None = None,
) -> list[Encounter]:
    """Find all pairs that may be conflicts, in order of time.

    Args:
        vehicles: the vehicles.
        config: thresholds.
        progress: hears how many vehicles of how many are done.

    Returns:
        Those with a probability above 0; `sure` tells which are beyond doubt.
    """
    order = sorted(range(len(vehicles)), key=lambda k: (vehicles[k].t[0], vehicles[k].track_id))
    boxes = [_reach(one) for one in vehicles]
    found = []
    for i, k in enumerate(order):
        one = vehicles[k]
        for j in order[i + 1 :]:
            other = vehicles[j]
            if other.t[0] > one.t[-1] + config.longest_s:
                break
            (low, high), (least, most) = boxes[k], boxes[j]
            if (low > most).any() or (least > high).any():
                continue
            encounter = _encounter(one, other, config)
            if encounter is not None and encounter.probability > 0.0:
                found.append(encounter)
        if progress is not None:
            progress(i + 1, len(order))
    return sorted(found, key=lambda e: (e.t, e.first, e.second))


def _reach(vehicle: Poses) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest x, y (m) that a vehicle may cover."""
    turn = np.abs(np.stack([np.sin(vehicle.mean[:, HEADING]), np.cos(vehicle.mean[:, HEADING])], axis=1))
    half = (turn * vehicle.mean[:, LENGTH, None] + turn[:, ::-1] * vehicle.mean[:, WIDTH, None]) / 2.0
    far = half + _BEYOND * vehicle.sigma[:, :2]
    return (vehicle.mean[:, :2] - far).min(axis=0), (vehicle.mean[:, :2] + far).max(axis=0)


def sure(encounter: Encounter, config: ConflictConfig) -> bool:
    """Whether it is a conflict with no more doubt than is allowed."""
    return encounter.probability >= 1.0 - config.most_doubt


def _encounter(one: Poses, other: Poses, config: ConflictConfig) -> Encounter | None:
    """Measure two vehicles; None where they do not come close."""
    meeting = _first_of(one, other, config)
    if meeting is None:
        return None
    if not _measured(meeting, config, _errors(_FEW)).probability:
        return None
    return _measured(meeting, config, _errors(_MANY))


def _measured(meeting: Meeting, config: ConflictConfig, z: FloatArray) -> Encounter:
    """Measure an encounter by draws with errors z (K, 12)."""
    first, second, t_first, t_second = meeting
    together = _least_ttc(first, second, z)
    at_second = second.at(np.array([t_second]))
    angle = _angle(first.at(np.array([t_first])), at_second)
    follow = angle < config.following_deg
    kind = REAR_END if follow else HEAD_ON if angle > 180.0 - config.following_deg else CROSSING
    ttc, drac, times = np.full(len(z), np.inf), np.zeros(len(z)), t_second
    crash = np.zeros(len(z), dtype=np.bool_)
    if together is not None:
        of_draws, crash, times = together
        ttc, drac = of_draws
    pet = _pet(meeting, z)
    hits = (ttc < config.ttc_s) | (drac > config.drac)
    if not follow:
        hits |= pet < config.pet_s
    # Both drove on, so what lies in one another is no near miss: wrong places, or one vehicle seen twice.
    hits &= ~crash & ~crash[0]
    place = second.at(np.array([times])).mean[0]
    headway = NOTHING
    if follow:
        leader = first.at(np.array([t_first])).drawn(z[:, :6])[:, 0]
        headway = _normal(pet + leader[:, LENGTH] / np.maximum(leader[:, SPEED], 0.1))
    return Encounter(
        first.track_id,
        second.track_id,
        first.kind,
        second.kind,
        kind,
        times,
        float(place[0]),
        float(place[1]),
        _quantiles(ttc),
        _quantiles(drac),
        _normal(pet),
        headway,
        float(hits.mean()),
    )


def _angle(a: Poses, b: Poses) -> float:
    turn = abs(float(a.mean[0, HEADING] - b.mean[0, HEADING])) % (2.0 * math.pi)
    return math.degrees(min(turn, 2.0 * math.pi - turn))


def _first_of(one: Poses, other: Poses, config: ConflictConfig) -> Meeting | None:
    """Return the one that is first where both come, the second, and about when each of them is there (s)."""
    a, b = (v.at(np.arange(v.t[0], v.t[-1], _COARSE_S)) for v in (one, other))
    if len(a.t) < 2 or len(b.t) < 2:
        return None
    apart = separation(a.mean[:, None], b.mean[None])
    later = b.t[None, :] - a.t[:, None]
    near = (apart <= 0.0) & (np.abs(later) <= config.longest_s)
    if not near.any():
        return None
    i, j = np.nonzero(near)
    if float(np.median(later[i, j])) < 0.0:
        one, other, a, b, apart, i, j = other, one, b, a, apart.T, j, i
    comes = arrivals(apart, a.t, b.t)
    at = int(np.argmin(comes))
    if math.isfinite(comes[at]):
        return Meeting(one, other, float(a.t[at]), float(a.t[at] + comes[at]))
    k = int(np.argmin(np.abs(b.t[j] - a.t[i])))
    return Meeting(one, other, float(a.t[i[k]]), float(b.t[j[k]]))


def _least_ttc(first: Poses, second: Poses, z: FloatArray) -> tuple[Collision, BoolArray, float] | None:
    """Least TTC and most DRAC of each draw, whether it is a crash, and when the estimate's TTC is least.

    None where they have no common times.
    """
    begin, end = max(first.t[0], second.t[0]), min(first.t[-1], second.t[-1])
    if end - begin < _STEP_S:
        return None
    t = np.arange(begin, end, _STEP_S)
    a, b = first.at(t), second.at(t)
    plain = collision(a.mean, b.mean)
    k = int(np.argmin(plain.ttc))
    if not np.isfinite(plain.ttc[k]):
        k = int(np.argmin(np.abs(separation(a.mean, b.mean))))
    around = np.abs(t - t[k]) <= _AROUND_S
    a, b = first.at(t[around]), second.at(t[around])
    drawn = collision(a.drawn(z[:, :6]), b.drawn(z[:, 6:]))
    crash = np.asarray((drawn.ttc == 0.0).any(axis=1), dtype=np.bool_)
    return Collision(drawn.ttc.min(axis=1), drawn.drac.max(axis=1)), crash, float(t[k])


def _pet(meeting: Meeting, drawn: FloatArray) -> FloatArray:
    """Post-encroachment time of each draw (K,), linear in its errors (K, 12) about the estimate."""
    first, second, t_first, t_second = meeting
    grids = []
    for one, t in ((first, t_first), (second, t_second)):
        here = one.at(np.array([t]))
        moved_s = 3.0 * float(here.sigma[0, :2].max()) / max(float(here.mean[0, SPEED]), 1.0)
        reach = _FINE_S + min(moved_s, 2.0)
        grids.append(np.linspace(max(t - reach, one.t[0]), min(t + reach, one.t[-1]), 2 * _FINE + 1))
    a, b = first.at(grids[0]), second.at(grids[1])
    states = np.eye(12)
    z = np.concatenate([np.zeros((1, 12)), states, -states])
    plain, up, down = np.split(encroachment(a.drawn(z[:, :6]), a.t, b.drawn(z[:, 6:]), b.t), [1, 13])
    slope = (up - down) / 2.0
    never = ~(np.isfinite(up) & np.isfinite(down))
    out = plain[0] + drawn[:, ~never] @ slope[~never]
    # Where an error of one standard deviation parts the ways, one of half as much may.
    parts = (never & (np.abs(drawn) > 0.5)).any(axis=1)
    return np.where(parts, np.inf, np.maximum(out, 0.0))


def _quantiles(values: FloatArray) -> Measured:
    """Estimate (the first draw's) and an interval by the draws (K,).

    The least of a noisy course is too small, and that of one drawn around it smaller still: the interval is
    that of the bias-corrected bootstrap (Efron and Tibshirani, *An Introduction to the Bootstrap*, ch. 14).
    """
    from scipy.special import ndtr, ndtri

    finite = np.where(np.isfinite(values), values, 1e9)
    below = (float((finite < finite[0]).sum()) + 0.5 * float((finite == finite[0]).sum())) / len(finite)
    bias = float(ndtri(np.clip(below, _LEAST_SHARE, 1.0 - _LEAST_SHARE)))
    low, high = np.quantile(finite, ndtr(2.0 * bias + np.array([-Z95, Z95])))
    ends = [math.inf if end > 1e8 else float(end) for end in (low, high)]
    return Measured(float(values[0]), *ends)


def _normal(values: FloatArray) -> Measured:
    """Estimate (the first draw's) and an interval by the spread of the draws that have one (K,)."""
    known = values[np.isfinite(values)]
    if not math.isfinite(values[0]) or len(known) < 0.5 * len(values):
        return NOTHING
    reach = Z95 * float(known.std())
    return Measured(float(values[0]), max(float(values[0]) - reach, 0.0), float(values[0]) + reach)
