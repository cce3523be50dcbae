"""A corridor while vehicles drive through it: identities, travel times, origin and destination, as they come.

Times of a corridor are by the clock of its first camera. What comes out are events, plain data: each vehicle
that has arrived at a camera, and, for each interval that is over, travel times and origin and destination.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Sequence
from typing import Any

import numpy as np

from jeat_graph.corridor.corridor_tables import mean_travel_time
from jeat_graph.corridor.learnt_gap import LearntGap
from jeat_graph.corridor.live_gap import Arrived, LiveGap, LivePassage, Traveller
from jeat_graph.road.speeds import KMH

Event = dict[str, Any]
#: A passage of a track that passed within this time (s) is the same one, reported again.
_SAME_S = 2.0
#: So many passages of each camera are remembered for that.
_MOST_REMEMBERED = 4096
#: Of so many vehicles the expected share that was followed rightly is reported, and doubted if it is below
#: this part of what was learnt.
_JUDGED, _LEAST_PART = 60, 0.55


class _Times:
    """Travel times of one gap: of each interval that is not over, and of the last while.

    Attributes:
        open: by interval, travel times with probabilities, and how many are expected to have gone this way.
        recent: time of arrival, travel time, probability that it is right, and that it came this way at all;
            of who was not followed the travel time is NaN.
        judged: of the last vehicles at the second camera, the probability that they were followed rightly.
    """

    def __init__(self) -> None:
        self.open: dict[int, tuple[list[float], list[float], list[float]]] = {}
        self.recent: deque[tuple[float, float, float, float]] = deque()
        self.judged: deque[float] = deque(maxlen=_JUDGED)

    def add(self, slot: int, t: float, travel: float, arrival: Arrived) -> None:
        travels, sure, expected = self.open.setdefault(slot, ([], [], []))
        if arrival.traveller is not None:
            travels.append(travel)
            sure.append(arrival.probability)
        expected.append(arrival.from_first)
        known = travel if arrival.traveller is not None else math.nan
        self.recent.append((t, known, arrival.probability, arrival.from_first))
        self.judged.append(arrival.probability)


class LiveCorridor:
    """Follows vehicles from camera to camera.

    Args:
        gaps: learnt, in the order in which traffic passes them, one chain.
        interval_s: length of the intervals, which begin at multiples of it.

    Attributes:
        order: names of the cameras.
        passages: by camera, how many vehicles have passed its line.
        followed: by gap, how many were followed through it.
        od: how many vehicles have ended their way, by the first and the last camera that they passed.
    """

    def __init__(self, gaps: Sequence[LearntGap], interval_s: float) -> None:
        self.order = [gaps[0].first, *(gap.second for gap in gaps)]
        self._gaps = [LiveGap(gap) for gap in gaps]
        self._interval_s = interval_s
        offsets = [gap.parameters.offset_s for gap in gaps]
        self._clock_s = [sum(offsets[:k]) for k in range(len(self.order))]
        self._now = [-math.inf] * len(self.order)
        self._reported: list[dict[int, float]] = [{} for _ in self.order]
        self._times = [_Times() for _ in gaps]
        self._ended: dict[int, Counter[tuple[str, str]]] = {}
        self._next_identity = 1
        self.passages: Counter[str] = Counter()
        self.followed: Counter[tuple[str, str]] = Counter()
        self.od: Counter[tuple[str, str]] = Counter()

    def at(self, camera: str, t: float) -> None:
        """Note that a camera's stream has come to a time (s, its clock)."""
        k = self.order.index(camera)
        self._now[k] = max(self._now[k], t)

    def passed(self, camera: str, passage: LivePassage) -> bool:
        """Take in a vehicle at a camera's line; whether it is new: after a fault some are reported again."""
        k = self.order.index(camera)
        reported = self._reported[k]
        if abs(reported.get(passage.track_id, -math.inf) - passage.t) < _SAME_S:
            return False
        reported.pop(passage.track_id, None)
        reported[passage.track_id] = passage.t
        while len(reported) > _MOST_REMEMBERED:
            del reported[next(iter(reported))]
        self.passages[camera] += 1
        if k:
            self._gaps[k - 1].arrive(passage)
        else:
            self._goes_on(0, self._new(passage, camera))
        return True

    def decide(self) -> list[Event]:
        """Decide about all who have been there for long enough; returns what is to be reported."""
        events: list[Event] = []
        until = self._now[0]
        for k, gap in enumerate(self._gaps):
            second = self._now[k + 1]
            if math.isfinite(until) or math.isfinite(second):
                arrived, departed = gap.decide(until, second)
                for one in arrived:
                    events += self._arrived(k, one)
                for traveller in departed:
                    self._ends(traveller, k)
                events += self._closed(k, until)
            until = gap.until(second)
        return [*events, *self._closed_od()]

    def _new(self, passage: LivePassage, camera: str) -> Traveller:
        self._next_identity += 1
        return Traveller(passage, self._next_identity - 1, camera)

    def _goes_on(self, k: int, traveller: Traveller) -> None:
        """Send a vehicle that has passed camera `k` into the next gap; at the last camera its way ends."""
        if k < len(self._gaps):
            self._gaps[k].leave(traveller)
        else:
            self._ends(traveller, k)

    def _ends(self, traveller: Traveller, k: int) -> None:
        ends = (traveller.origin, self.order[k])
        self.od[ends] += 1
        slot = self._slot(traveller.passage.t - self._clock_s[k])
        self._ended.setdefault(slot, Counter())[ends] += 1

    def _slot(self, t: float) -> int:
        return math.floor(t / self._interval_s)

    def _arrived(self, k: int, one: Arrived) -> list[Event]:
        gap, passage = self._gaps[k], one.passage
        p, camera = gap.learnt.parameters, self.order[k + 1]
        common = passage.t - self._clock_s[k + 1]
        if one.traveller is None:
            start = common - gap.travel_s(passage.log_speed)
            self._times[k].add(self._slot(start), common, math.nan, one)
            self._goes_on(k + 1, self._new(passage, camera))
            return []
        before = one.traveller.passage
        travel = passage.t - before.t - p.offset_s
        self._times[k].add(self._slot(before.t - self._clock_s[k]), common, travel, one)
        self.followed[self.order[k], camera] += 1
        self._goes_on(k + 1, Traveller(passage, one.traveller.identity, one.traveller.origin))
        return [
            {
                "t": round(common, 4),
                "event": "passage",
                "identity": one.traveller.identity,
                "from": self.order[k],
                "to": camera,
                "from_track_id": before.track_id,
                "to_track_id": passage.track_id,
                "travel_time_s": round(travel, 3),
                "speed_kmh": round(KMH * p.distance_m / travel, 2),
                "class": passage.kind or before.kind,
                "probability": round(one.probability, 4),
            }
        ]

    def _closed(self, k: int, until: float) -> list[Event]:
        """Return travel times of the intervals in which nobody is on the way any more."""
        times, gap = self._times[k], self._gaps[k]
        over = self._slot(until - self._clock_s[k]) if math.isfinite(until) else -math.inf
        if gap.on_way:
            over = min(over, self._slot(gap.on_way[0].passage.t - self._clock_s[k]))
        events = []
        for slot in sorted(one for one in times.open if one < over):
            travels, sure, expected = times.open.pop(slot)
            events.append(
                {
                    "t": (slot + 1) * self._interval_s,
                    "event": "travel-time",
                    "from": self.order[k],
                    "to": self.order[k + 1],
                    "begin": slot * self._interval_s,
                    "end": (slot + 1) * self._interval_s,
                    "vehicles": len(travels),
                    **self._mean(k, travels, sure, sum(expected)),
                }
            )
        return events

    def _mean(self, k: int, travels: list[float], sure: list[float], expected: float) -> dict[str, Any]:
        variance = self._gaps[k].learnt.offset_variance
        numbers = mean_travel_time(np.array(travels), np.array(sure), expected, variance)
        names = ("expected", "mean_s", "low_s", "high_s", "median_s")
        return {
            name: round(value, 3) if math.isfinite(value) else None
            for name, value in zip(names, numbers, strict=True)
        }

    def _closed_od(self) -> list[Event]:
        """Return who ended where in the intervals that are over: nobody who passed a camera then is open."""
        now = max(self._now[k] - self._clock_s[k] for k in range(len(self.order)))
        over = self._slot(now) if math.isfinite(now) else -math.inf
        for k, gap in enumerate(self._gaps):
            for t in [one.passage.t - self._clock_s[k] for one in gap.on_way[:1]]:
                over = min(over, self._slot(t))
            second = self._now[k + 1]
            if math.isfinite(second):
                over = min(over, self._slot(gap.until(second) - self._clock_s[k + 1]))
        return [
            {
                "t": (slot + 1) * self._interval_s,
                "event": "od",
                "begin": slot * self._interval_s,
                "end": (slot + 1) * self._interval_s,
                "ways": [
                    {"from": first, "to": last, "vehicles": count}
                    for (first, last), count in sorted(self._ended.pop(slot).items())
                ],
            }
            for slot in sorted(one for one in self._ended if one < over)
        ]

    def shown(self) -> dict[str, Any]:
        """Return how the corridor is doing, as plain data: what `/health` says, and metrics are made of."""
        return {
            "cameras": {name: {"passages": self.passages[name]} for name in self.order},
            "gaps": [self._gap_shown(k) for k in range(len(self._gaps))],
            "od": [
                {"from": first, "to": last, "vehicles": count}
                for (first, last), count in sorted(self.od.items())
            ],
            "problems": [text for k in range(len(self._gaps)) for text in self._problems(k)],
        }

    def _gap_shown(self, k: int) -> dict[str, Any]:
        gap, times = self._gaps[k], self._times[k]
        newest = self._now[k + 1] - self._clock_s[k + 1]
        recent = [one for one in times.recent if one[0] >= newest - self._interval_s]
        times.recent = deque(recent)
        followed = [one for one in recent if not math.isnan(one[1])]
        expected = sum(one[3] for one in recent)
        mean = self._mean(k, [one[1] for one in followed], [one[2] for one in followed], expected)
        appearance = gap.learnt.parameters.appearance if gap.compares_appearance else None
        return {
            "from": self.order[k],
            "to": self.order[k + 1],
            "on_way": len(gap.on_way),
            "followed": self.followed[self.order[k], self.order[k + 1]],
            "followed_share": sum(times.judged) / len(times.judged) if times.judged else None,
            "learnt_share": 1.0 - gap.learnt.new_share,
            "d_prime": None if appearance is None else round(appearance.d_prime, 2),
            "slowness": round(gap.slowness_now - gap.learnt.slowness, 4),
            "vehicles": len(followed),
            **mean,
        }

    def _problems(self, k: int) -> list[str]:
        gap, judged = self._gaps[k], self._times[k].judged
        name, learnt, found = f"{self.order[k]}-{self.order[k + 1]}", 1.0 - gap.learnt.new_share, []
        if len(judged) == _JUDGED and sum(judged) < _LEAST_PART * learnt * len(judged):
            found.append(
                f"{name}: {sum(judged):.0f} of the last {len(judged)} vehicles at {self.order[k + 1]} are "
                f"followed, where {100.0 * learnt:.0f} % came this way when learnt: "
                "do the clocks still agree?"
            )
        if gap.other_numbers:
            found.append(
                f"{name}: embeddings of {gap.other_numbers} numbers come, and those learnt have "
                f"{gap.learnt.numbers}: they are not compared; use the embedder that `handover` was given"
            )
        return found

    def state(self) -> dict[str, Any]:
        """Return what `set_state` takes: plain data."""
        return {
            "order": self.order,
            "interval_s": self._interval_s,
            "now": [t if math.isfinite(t) else None for t in self._now],
            "reported": [list(map(list, reported.items())) for reported in self._reported],
            "gaps": [gap.state() for gap in self._gaps],
            "times": [
                {
                    "open": [[slot, *map(list, values)] for slot, values in times.open.items()],
                    "recent": [
                        [t, None if math.isnan(travel) else travel, p, q] for t, travel, p, q in times.recent
                    ],
                    "judged": list(times.judged),
                }
                for times in self._times
            ],
            "ended": [[slot, _rows(counts)] for slot, counts in self._ended.items()],
            "next_identity": self._next_identity,
            "passages": dict(self.passages),
            "followed": _rows(self.followed),
            "od": _rows(self.od),
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Go on from what `state` returned.

        Raises:
            ValueError: it is of other cameras or intervals.
        """
        if state["order"] != self.order or state["interval_s"] != self._interval_s:
            raise ValueError("is of other cameras, or of another interval")
        self._now = [-math.inf if t is None else t for t in state["now"]]
        self._reported = [{int(k): float(t) for k, t in reported} for reported in state["reported"]]
        for gap, one in zip(self._gaps, state["gaps"], strict=True):
            gap.set_state(one)
        for times, one in zip(self._times, state["times"], strict=True):
            times.open = {slot: (travels, sure, expected) for slot, travels, sure, expected in one["open"]}
            times.recent = deque(
                (t, math.nan if travel is None else travel, p, q) for t, travel, p, q in one["recent"]
            )
            times.judged = deque(one["judged"], maxlen=_JUDGED)
        self._ended = {slot: _counter(rows) for slot, rows in state["ended"]}
        self._next_identity = state["next_identity"]
        self.passages = Counter(state["passages"])
        self.followed, self.od = _counter(state["followed"]), _counter(state["od"])


def _rows(counts: Counter[tuple[str, str]]) -> list[list[Any]]:
    return [[*ends, count] for ends, count in sorted(counts.items())]


def _counter(rows: list[list[Any]]) -> Counter[tuple[str, str]]:
    return Counter({(first, last): count for first, last, count in rows})
