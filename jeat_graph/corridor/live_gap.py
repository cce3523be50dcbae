"""A gap while vehicles drive through it: who is on the way, and who of them has just arrived.

The model is that of the recordings (`gap_model`), with what was learnt from them. A vehicle at the second
camera is decided about some seconds after it has come, when those that it might be confused with have come
too. What is estimated all the time is the slowness that vehicles share, from those that have arrived.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.association.matching_marginals import best_matching, matching_marginals
from jeat_graph.corridor.gap_model import (
    WINDOW,
    Gap,
    GapParameters,
    PassagePairs,
    candidate_pairs,
    log_ratios,
    pair_times,
    traffic_speed,
)
from jeat_graph.corridor.learnt_gap import LearntGap
from jeat_graph.corridor.live_appearance import CameraAppearance
from jeat_graph.corridor.passages import Passages
from jeat_graph.corridor.shared_slowness import pooled, smoothed
from jeat_graph.data.arrays import FloatArray, IntArray

#: A vehicle is decided about so long after it has come: a share of the travel time, and the least (s).
_LAG_SHARE, _LEAST_LAG_S = 0.25, 2.0
#: It waits no longer than this (s) for a first camera whose scans come later.
_HOLD_S = 60.0
#: If the second camera is silent, vehicles stay on the way for so long (s) beyond the longest travel time.
_SILENT_S = 900.0
#: A pair is handed over from this probability on: then it is more often right than wrong.
LEAST_PROBABILITY = 0.5
#: Of those that have arrived so many are remembered at most, for so many correlation times of the slowness.
_MOST_KNOWN, _MEMORY_TIMES = 150, 5.0
#: No more vehicles than this are on the way, or wait to be decided about.
_MOST_OPEN = 3000
#: Standard deviation (of ln travel time) and correlation time (s) of what a lane has of its own.
_LANE_SD, _LANE_TIME_S = 0.03, 60.0
#: The rate of arrivals is taken over this time (s), and begins with one vehicle in this time (s).
_FLOW_S, _FLOW_BEGIN_S = 600.0, 30.0
_SPREADS = 4.0
_ROUNDS = 2


class LivePassage(NamedTuple):
    """A vehicle at the line of a camera; plain data.

    Attributes:
        track_id: its identity at that camera.
        t: by the camera's clock (s).
        sigma_t: its standard deviation (s).
        log_speed: ln of the speed in m/s.
        sigma_speed: its standard deviation.
        lane: name, or empty.
        kind: class, or empty.
        appearance: its embedding (`data.embeddings.packed_embedding`), or empty.
    """

    track_id: int
    t: float
    sigma_t: float
    log_speed: float
    sigma_speed: float
    lane: str = ""
    kind: str = ""
    appearance: str = ""


class Traveller(NamedTuple):
    """A vehicle that is on the way.

    Attributes:
        passage: at the camera where it was last.
        identity: in the corridor.
        origin: name of the first camera that it passed.
    """

    passage: LivePassage
    identity: int
    origin: str


class Arrived(NamedTuple):
    """A vehicle at the second camera that has been decided about.

    Attributes:
        passage: there.
        traveller: who it is; None: it came from elsewhere, or who it is is in doubt.
        probability: that it is that one; 0 where there is none.
        from_first: probability that it came from the first camera at all.
    """

    passage: LivePassage
    traveller: Traveller | None
    probability: float
    from_first: float


class Decided(NamedTuple):
    """What has been decided.

    Attributes:
        arrived: at the second camera, in order of time.
        departed: vehicles that are on the way no longer: they left, or were missed.
    """

    arrived: list[Arrived]
    departed: list[Traveller]


class _LiveWindow(NamedTuple):
    """Passages of both cameras that count now, in order of time, and which rows are open."""

    gap: Gap
    open_before: IntArray
    open_after: IntArray
    known: PassagePairs
    known_weight: FloatArray


class LiveGap:
    """Follows vehicles through one gap.

    Args:
        learnt: the gap.

    Attributes:
        learnt: the gap.
        on_way: vehicles between the cameras, in order of time.
        slowness_now: θ of the newest vehicle.
    """

    def __init__(self, learnt: LearntGap) -> None:
        self.learnt = learnt
        self.on_way: list[Traveller] = []
        self.slowness_now = learnt.slowness
        self._waiting: list[LivePassage] = []
        self._known: list[tuple[LivePassage, LivePassage, float]] = []
        self._came: list[float] = []
        self._appearance = CameraAppearance(learnt.numbers), CameraAppearance(learnt.numbers)

    @property
    def compares_appearance(self) -> bool:
        """Whether embeddings count: something was learnt of them, and enough have come at both cameras."""
        return all(one.known for one in self._appearance)

    @property
    def other_numbers(self) -> int:
        """Numbers of an embedding that has come and cannot be compared with those learnt; 0 if none has."""
        return max(one.other_numbers for one in self._appearance)

    def leave(self, traveller: Traveller) -> None:
        """Take in a vehicle that has passed the first camera."""
        self._appearance[0].add(traveller.passage.appearance)
        self.on_way.append(traveller)
        self.on_way.sort(key=lambda one: one.passage.t)

    def arrive(self, passage: LivePassage) -> None:
        """Take in a vehicle at the second camera."""
        self._appearance[1].add(passage.appearance)
        self._waiting.append(passage)
        self._waiting.sort(key=lambda one: one.t)
        self._came.append(passage.t)

    def until(self, now: float) -> float:
        """Return up to which time (s) all vehicles at the second camera have been decided about."""
        return min([one.t for one in self._waiting[:1]], default=now)

    def decide(self, first_until: float, second_now: float) -> Decided:
        """Decide about those who have been there for long enough.

        Args:
            first_until: up to which time all passages at the first camera have been taken in (s, its clock).
            second_now: time now at the second camera (s, its clock).
        """
        due = [self._is_due(one, first_until, second_now) for one in self._waiting]
        due += [True] * max(len(due) - _MOST_OPEN, 0)
        arrived = self._settled(due[: len(self._waiting)], second_now) if any(due) else []
        kept: list[Traveller] = []
        departed: list[Traveller] = []
        for one in self.on_way:
            (departed if self._has_departed(one.passage, first_until, second_now) else kept).append(one)
        over = max(len(kept) - _MOST_OPEN, 0)
        self.on_way, departed = kept[over:], departed + kept[:over]
        return Decided(arrived, departed)

    def travel_s(self, log_speed: float) -> float:
        """Return the travel time (s) that a speed (ln of m/s) leads to, as vehicles travel now."""
        return self.learnt.parameters.distance_m * math.exp(self.slowness_now - log_speed)

    def _is_due(self, one: LivePassage, first_until: float, second_now: float) -> bool:
        p, travel = self.learnt.parameters, self.travel_s(one.log_speed)
        if second_now < one.t + max(_LAG_SHARE * travel, _LEAST_LAG_S):
            return False
        latest_start = one.t - p.offset_s - travel * math.exp(-_SPREADS * p.spread)
        return first_until >= latest_start or second_now >= one.t + _HOLD_S

    def _has_departed(self, one: LivePassage, first_until: float, second_now: float) -> bool:
        p = self.learnt.parameters
        longest = p.distance_m * math.exp(
            max(self.slowness_now, self.learnt.slowness) + WINDOW - one.log_speed
        )
        end = one.t + longest + max(_LAG_SHARE * longest, _LEAST_LAG_S)
        return second_now - p.offset_s > end + _HOLD_S or first_until > end + _SILENT_S

    def _settled(self, due: Sequence[bool], second_now: float) -> list[Arrived]:
        window = self._window(second_now)
        p = self._parameters(second_now)
        pairs, probability, varying = self._solved(window, p)
        self.slowness_now = self.learnt.slowness + (float(varying[-1]) if len(varying) else 0.0)
        rows, columns = len(self.on_way), len(self._waiting)
        best = best_matching(pairs.i, pairs.j, probability, rows, columns)
        chosen = {int(pairs.j[k]): k for k in np.flatnonzero(best & (probability >= LEAST_PROBABILITY))}
        from_first = np.bincount(pairs.j, probability, columns)
        arrived, taken = [], set()
        for j, passage in enumerate(self._waiting):
            if not due[j]:
                continue
            k = chosen.get(j)
            traveller = None if k is None else self.on_way[int(pairs.i[k])]
            sure = 0.0 if k is None else float(probability[k])
            if traveller is not None:
                taken.add(int(pairs.i[k]))
                before, after = (one._replace(appearance="") for one in (traveller.passage, passage))
                self._known.append((before, after, sure))
            arrived.append(Arrived(passage, traveller, sure, min(float(from_first[j]), 1.0)))
        self.on_way = [one for i, one in enumerate(self.on_way) if i not in taken]
        self._waiting = [one for j, one in enumerate(self._waiting) if not due[j]]
        self._forget(second_now)
        return arrived

    def _forget(self, second_now: float) -> None:
        since = second_now - _MEMORY_TIMES * self.learnt.slowness_time_s - _FLOW_S
        self._known = [one for one in self._known if one[1].t >= since][-_MOST_KNOWN:]
        self._came = [t for t in self._came if t >= second_now - _FLOW_S]

    def _parameters(self, second_now: float) -> GapParameters:
        """Return the parameters of now: the rate of arrivals from elsewhere, and whether looks count."""
        recent = [t for t in self._came if t >= second_now - _FLOW_S]
        span = min(second_now - min(recent, default=second_now), _FLOW_S)
        flow = (len(recent) + 1.0) / (span + _FLOW_BEGIN_S)
        p = self.learnt.parameters
        appearance = p.appearance if self.compares_appearance else None
        return replace(p, rate=self.learnt.new_share * flow, appearance=appearance)

    def _window(self, second_now: float) -> _LiveWindow:
        known = self._known
        first = [one[0] for one in known] + [one.passage for one in self.on_way]
        second = [one[1] for one in known] + self._waiting
        before, place_before = _passages(first, self.learnt.first, self._names(0), second_now)
        after, place_after = _passages(second, self.learnt.second, self._names(1), second_now)
        n = len(known)
        compared = None
        if self.compares_appearance:
            compared = (
                _in_order(self._appearance[0].centred([one.appearance for one in first]), place_before),
                _in_order(self._appearance[1].centred([one.appearance for one in second]), place_after),
            )
        gap = Gap(
            before,
            after,
            traffic_speed(before),
            traffic_speed(after),
            apart_variance=self.learnt.own_variance,
            known_appearance=compared,
        )
        weight = np.array([one[2] for one in known], dtype=np.float64)
        return _LiveWindow(
            gap, place_before[n:], place_after[n:], PassagePairs(place_before[:n], place_after[:n]), weight
        )

    def _names(self, side: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
        return self.learnt.lanes[side], self.learnt.kinds[side]

    def _solved(self, window: _LiveWindow, p: GapParameters) -> tuple[PassagePairs, FloatArray, FloatArray]:
        """Return pairs by their places in `on_way` and `_waiting`, their probabilities, and θ − its mean."""
        gap, a, b = window.gap, len(window.gap.before), len(window.gap.after)
        rows, columns = np.full(a, -1), np.full(b, -1)
        rows[window.open_before] = np.arange(len(window.open_before))
        columns[window.open_after] = np.arange(len(window.open_after))
        pairs, probability = PassagePairs(np.zeros(0, np.int64), np.zeros(0, np.int64)), np.zeros(0)
        varying = self._varying(window, p, pairs, probability)
        for _ in range(_ROUNDS):
            slowness = self.learnt.slowness + varying
            found = candidate_pairs(gap, p, slowness)
            both = (rows[found.i] >= 0) & (columns[found.j] >= 0)
            pairs = PassagePairs(found.i[both], found.j[both])
            ratio = log_ratios(gap, pairs, p, slowness, pair_times(gap, pairs, p, slowness))
            places = rows[pairs.i], columns[pairs.j]
            probability = matching_marginals(*places, ratio, len(self.on_way), len(self._waiting)).pair
            varying = self._varying(window, p, pairs, probability)
        return PassagePairs(rows[pairs.i], columns[pairs.j]), probability, varying

    def _varying(
        self, window: _LiveWindow, p: GapParameters, pairs: PassagePairs, probability: FloatArray
    ) -> FloatArray:
        """Return θ less its mean (A,), from pairs and those who have arrived; a lane has some of its own."""
        gap = window.gap
        i = np.concatenate([window.known.i, pairs.i])
        all_pairs = PassagePairs(i, np.concatenate([window.known.j, pairs.j]))
        level = np.full(len(gap.before), self.learnt.slowness)
        times = pair_times(gap, all_pairs, p, level)
        weight = np.concatenate([window.known_weight, probability]) * times.of_traffic(1.0)
        t, lane = gap.before.t, gap.before.lane
        value, noise = pooled(i, times.error, times.variance, weight, len(t))
        out = smoothed(t, value, noise, self.learnt.slowness_sd, self.learnt.slowness_time_s)
        common = out.copy()
        for one in np.unique(lane[lane >= 0]):
            own = np.flatnonzero(lane == one)
            out[own] += smoothed(t[own], value[own] - common[own], noise[own], _LANE_SD, _LANE_TIME_S)
        return out

    def state(self) -> dict[str, Any]:
        """Return what `set_state` takes: plain data."""
        return {
            "on_way": [[list(one.passage), one.identity, one.origin] for one in self.on_way],
            "waiting": [list(one) for one in self._waiting],
            "known": [[list(a), list(b), p] for a, b, p in self._known],
            "came": list(self._came),
            "slowness": self.slowness_now,
            "appearance": [one.state() for one in self._appearance],
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Go on from what `state` returned."""
        self.on_way = [Traveller(LivePassage(*one), k, origin) for one, k, origin in state["on_way"]]
        self._waiting = [LivePassage(*one) for one in state["waiting"]]
        self._known = [(LivePassage(*a), LivePassage(*b), p) for a, b, p in state["known"]]
        self._came, self.slowness_now = list(state["came"]), float(state["slowness"])
        for one, saved in zip(self._appearance, state["appearance"], strict=True):
            one.set_state(saved)


def _in_order(values: FloatArray, place: IntArray) -> FloatArray:
    """Return rows (N, E), each at its place (N,)."""
    out = np.empty_like(values)
    out[place] = values
    return out


def _passages(
    rows: Sequence[LivePassage], camera: str, names: tuple[tuple[str, ...], tuple[str, ...]], now: float
) -> tuple[Passages, IntArray]:
    """Return passages in order of time, and the place (N,) of each row among them."""
    t = np.array([one.t for one in rows], dtype=np.float64)
    order = np.argsort(t, kind="stable")
    place = np.empty(len(rows), dtype=np.int64)
    place[order] = np.arange(len(rows))
    ordered = [rows[k] for k in order]
    lanes, kinds = ({name: k for k, name in enumerate(own)} for own in names)
    unknown = np.full(len(rows), np.nan)
    return (
        Passages(
            camera,
            "",
            np.array([one.track_id for one in ordered], dtype=np.int64),
            t[order],
            np.array([one.sigma_t for one in ordered], dtype=np.float64),
            np.array([one.log_speed for one in ordered], dtype=np.float64),
            np.array([one.sigma_speed for one in ordered], dtype=np.float64),
            np.array([lanes.get(one.lane, -1) for one in ordered], dtype=np.int64),
            unknown,
            unknown,
            np.array([kinds.get(one.kind, -1) for one in ordered], dtype=np.int64),
            *names,
            (-math.inf, now),
        ),
        place,
    )
