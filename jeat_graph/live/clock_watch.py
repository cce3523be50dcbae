"""Finds the clocks of running sensors, by what `track` does before it tracks (`runs.clock_comparison`).

The latest detections of each sensor are kept. They are compared after 15, 30, 45 and 60 s of two sensors'
own times, then ever more seldom, a few steps of the work with each message. Two comparisons in a row must say
the same before anything is taken off. Nothing asks for the clock on the wall, or for how long the work takes:
the same scans in the same order always give the same.

A clock that was found, or that a rig gives, is compared again when it has stepped (`clock_steps`), and every
ten minutes. Between, one that drifts is followed by what vehicles' boxes show (`clock_drift`).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from jeat_graph.config.schema import Config
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.scan import trusted_scan
from jeat_graph.live.clock_drift import ClockDrift
from jeat_graph.runs.clock_comparison import (
    LEAST_S,
    ClockComparison,
    FoundClock,
    compare_in_steps,
    summary_of,
    taken_off_each,
    unsure_of,
)

#: So much of each sensor is kept (s), scans that are not nearer to each other than this (s).
WINDOW_S, _APART_S = 60.0, 0.03
#: Sensors are compared when two of them have been heard for so long (s); later at doubled times, up to this.
_FIRST_S, _EARLY, _MOST_BETWEEN_S = 15.0, 4, 3600.0
# So much is tracked for the exact offset (s): it bounds the work.
_COMPARED_S = 25.0
# Steps of the work for each second that a sensor goes on, and at most with one message.
_STEPS_A_SECOND, _MOST_STEPS = 250.0, 25
#: Clocks that are known are compared again after so long (s), and then so often at most.
AGAIN_S, _MOST_AGAIN = 600.0, _EARLY
# Two comparisons say the same where they differ by no more than this, or so many standard deviations.
_SAME_S, _SAME_STD = 0.005, 4.0
# So many scans in a row that are far from the sensor's others are its new time.
_BELIEVED = 3


class ClockNews(NamedTuple):
    """What a comparison of the sensors has brought.

    Attributes:
        taken_off: by sensor, what is taken off its times from now on, beside what was before.
        newest: by sensor, the newest of its times before that (s).
        lines: what is to be reported.
    """

    taken_off: dict[str, FoundClock]
    newest: dict[str, float]
    lines: list[str]


@dataclass
class _Heard:
    """What has been heard of a sensor since it is watched.

    Attributes:
        begun: time of its first scan (s).
        scans: its latest, in order of time.
        odd: scans in a row that were far from these.
    """

    begun: float
    scans: deque[Scan] = field(default_factory=deque)
    odd: int = 0

    @property
    def newest(self) -> float:
        """Time of its newest scan (s)."""
        return self.scans[-1].t

    def state(self) -> dict[str, Any]:
        """Return plain data."""
        return {"begun": self.begun, "scans": list(self.scans), "odd": self.odd}


_Compared = dict[str, ClockComparison]


class ClockWatch:
    """Watches the clocks of sensors that nobody has given.

    Args:
        config: `input.clocks` says whether to look, `sensors` which clocks are given: where any sensor has a
            `clock` (a rig), all begin as known; one with a `latency_s` is never looked at.

    Attributes:
        clocks: by sensor what is taken off its times: `lag_s`, `std_s`, and `at_s`, the time of its scan at
            which that was found.
    """

    def __init__(self, config: Config) -> None:
        self._jump_s = config.live.jump_s
        self._rig = any(sensor.clock is not None for sensor in config.sensors.values())
        self._compares = config.input.clocks == "find"
        self._given = {name for name, sensor in config.sensors.items() if sensor.latency_s != 0.0}
        self.clocks: dict[str, dict[str, float]] = {}
        self._met: list[str] = []  # in order of their first scans
        self._settled: list[str] = []
        self._again = False  # whether what is known is being compared again
        self._settled_at: float | None = None  # newest time when all were known (s)
        self._warned: list[str] = []
        self._heard: dict[str, _Heard] = {}
        self._compared = 0  # comparisons since somebody new was met, or a clock jumped
        self._last: dict[str, list[float]] = {}  # by pair, lag and its std by the last comparison
        self._window: dict[str, list[Scan]] = {}  # what is being compared
        self._done = 0  # steps of that
        self._work: Generator[None, None, tuple[str, _Compared]] | None = None
        self._drift = ClockDrift()

    def lag_s(self, sensor: str) -> float:
        """Return what is taken off a sensor's times (s)."""
        found = self.clocks.get(sensor)
        return 0.0 if found is None else found["lag_s"]

    def saw(self, scans: Sequence[Scan]) -> ClockNews | None:
        """Take note of scans, and do a little of what is to be done.

        Args:
            scans: which have not come before; what was found (`lag_s`) is taken off their times.
        """
        if not self._compares:
            return None
        watched = [scan for scan in scans if scan.sensor not in self._given]
        self._meet(watched)
        if not self._waits_for_another() and len(self._settled) == len(self._met):
            self._compare_again_in_time(watched)
            return self._follow(watched)
        steps = sum(self._hear(scan) for scan in watched)
        if self._work is None and self._is_due():
            self._window = {name: list(one.scans) for name, one in sorted(self._heard.items())}
            self._begin_work()
        if self._work is not None:
            for _ in range(min(steps, _MOST_STEPS)):
                self._done += 1
                try:
                    next(self._work)
                except StopIteration as end:
                    self._work, self._window, self._done = None, {}, 0
                    self._compared += 1
                    return self._conclude(*end.value)
        return None

    def _follow(self, scans: Sequence[Scan]) -> ClockNews | None:
        """Take off what known clocks have drifted."""
        if len(self._settled) < 2:
            return None
        found = self._drift.saw(scans, self._settled[0])
        newest = {scan.sensor: scan.t for scan in scans}
        lines: list[str] = []
        for name, drifted in found.items():
            lag_s = round(self.lag_s(name) + drifted.lag_s, 6)
            at_s = newest.setdefault(name, max(newest.values()))
            self.clocks[name] = {"lag_s": lag_s, "std_s": drifted.std_s, "at_s": at_s}
            if f"{name} drifts" not in self._warned:
                self._warned.append(f"{name} drifts")
                lines.append(
                    f"sensor {name!r}: its clock drifts: its boxes are {drifted.lag_s:+.3f} s late beside "
                    f"those of {self._settled[0]!r}, which is taken off, and followed from now on (--set "
                    "input.clocks=as_given leaves it)"
                )
        return ClockNews(found, newest, lines) if found else None

    def _meet(self, scans: Sequence[Scan]) -> None:
        """Watch sensors that are heard for the first time."""
        for scan in scans:
            if scan.sensor not in self._met:
                self._met.append(scan.sensor)
                if self._rig:
                    self._settled.append(scan.sensor)
                    continue
                self._compared, self._last = 0, {}
                self._window, self._done, self._work = {}, 0, None
        if len(self._met) == 1 and not self._settled and not self._waits_for_another():
            self._settled = list(self._met)  # it is alone, and what it says is not kept any longer
            self._reset()

    def stepped(self, sensor: str, step_s: float, std_s: float, at_s: float) -> FoundClock:
        """Take a step of a sensor's clock off its times, and have that compared with the others' boxes.

        Args:
            sensor: whose.
            step_s: by how much it is ahead (s), of times from which the clock's known offset is taken off.
            std_s: how exactly that is known (s).
            at_s: the sensor's time before (s).
        """
        before = self.lag_s(sensor)
        self.clocks[sensor] = {"lag_s": round(before + step_s, 6), "std_s": std_s, "at_s": at_s}
        self._drift.forget()
        self._reset()
        if sensor in self._settled and len(self._settled) > 1:
            self._settled.remove(sensor)
            self._again = True
        return FoundClock(step_s, std_s, True)

    def _compare_again_in_time(self, scans: Sequence[Scan]) -> None:
        """Compare all with the first again, after a while."""
        if len(self._met) < 2 or not scans:
            return
        t = max(scan.t for scan in scans)
        if self._settled_at is None or not 0.0 <= t - self._settled_at <= AGAIN_S + WINDOW_S:
            self._settled_at = t  # from here, or from here again after a leap
        elif t - self._settled_at >= AGAIN_S:
            self._settled_at = None
            self._settled, self._again = self._settled[:1], True
            self._reset()

    def _waits_for_another(self) -> bool:
        """Whether there is but one sensor, and that not for long."""
        if len(self._met) != 1 or self._settled:
            return False
        return all(one.newest - one.begun < WINDOW_S for one in self._heard.values())

    def _reset(self) -> None:
        """Forget what was heard: there is another time, or all is known."""
        self._heard, self._last, self._compared = {}, {}, 0
        self._window, self._done, self._work = {}, 0, None
        self._drift.forget()

    def _hear(self, scan: Scan) -> int:
        """Take note of one scan; how many steps of the work are due with it."""
        t = scan.t
        one = self._heard.get(scan.sensor)
        if one is None:
            one = self._heard[scan.sensor] = _Heard(t)
        elif abs(t - one.newest) > self._jump_s:
            one.odd += 1
            if one.odd < _BELIEVED:
                return 0
            self._reset()
            one = self._heard[scan.sensor] = _Heard(t)
        elif t < one.newest + _APART_S:
            return 0
        one.odd = 0
        step_s = t - one.newest if one.scans else 0.0
        one.scans.append(trusted_scan(t, scan.sensor, scan.boxes, scan.scores, None, None, None, None))
        while one.scans[0].t < t - WINDOW_S:
            one.scans.popleft()
        return math.ceil(_STEPS_A_SECOND * step_s)

    def _is_due(self) -> bool:
        spans = sorted(one.newest - one.begun for one in self._heard.values())
        return len(spans) > 1 and spans[-2] >= _due_s(self._compared)

    def _begin_work(self) -> None:
        settled = [name for name in self._met if name in self._settled]
        self._work = _compare_all(self._window, settled, self._again)

    def _conclude(self, reference: str, compared: _Compared) -> ClockNews | None:
        """Say what a comparison comes to."""
        sure: dict[str, FoundClock] = {}
        agree: list[str] = []
        lines: list[str] = []
        last, self._last = self._last, {}
        for name, one in compared.items():
            found = one.differ
            if one.agree:
                agree.append(name)
            elif one.contradiction:
                lines += self._once(f"{reference}|{name}", one.contradiction)
            elif found is not None and found.sure:
                # Which of two is the reference may change from one comparison to the next.
                pair, sign = "|".join(sorted((name, reference))), 1.0 if name > reference else -1.0
                self._last[pair] = [sign * found.lag_s, found.std_s]
                if pair in last and _same(last[pair], self._last[pair]):
                    sure[name] = found
            elif found is not None:
                lines += self._once(name, unsure_of(name, reference, found))
        if self._again and not (agree or sure) and self._compared >= _MOST_AGAIN:
            self._settled += [name for name in self._met if name not in self._settled]  # as they were
        newest = {name: one.newest for name, one in self._heard.items()}
        taken: dict[str, FoundClock] = {}
        if sure:
            fixed = reference in self._settled
            taken = sure if fixed else taken_off_each([reference, *agree, *sure], sure)
        for name, found in taken.items():
            before = self.clocks.get(name, {"lag_s": 0.0})["lag_s"]
            lag_s = round(before + found.lag_s, 6)
            self.clocks[name] = {"lag_s": lag_s, "std_s": round(found.std_s, 6), "at_s": newest[name]}
            lines.append(summary_of(name, lag_s, found.std_s))
        fresh = [name for name in (reference, *agree, *sure) if name not in self._settled]
        if agree or sure:
            self._settled += fresh
        if taken or len(self._settled) == len(self._met):
            self._reset()
            self._again = self._again and len(self._settled) < len(self._met)
        return ClockNews(taken, newest, lines) if taken or lines else None

    def _once(self, key: str, line: str) -> list[str]:
        """Return a line that was not reported yet; what a minute shows is not reported before."""
        if key in self._warned or self._compared < _EARLY:
            return []
        self._warned.append(key)
        return [line]

    def state(self) -> dict[str, Any]:
        """Return plain data, for `set_state`."""
        return {
            "clocks": self.clocks,
            "met": self._met,
            "settled": self._settled,
            "again": self._again,
            "settled_at": self._settled_at,
            "warned": self._warned,
            "heard": {name: one.state() for name, one in self._heard.items()},
            "compared": self._compared,
            "last": self._last,
            "window": self._window,
            "done": self._done,
            "drift": self._drift.state(),
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go on from what `state` returned: a comparison that had begun is done again up to there."""
        self.clocks = {name: dict(one) for name, one in state["clocks"].items()}
        self._met, self._settled = list(state["met"]), list(state["settled"])
        self._again, self._settled_at = state["again"], state["settled_at"]
        self._warned, self._compared = list(state["warned"]), state["compared"]
        self._heard = {
            name: _Heard(one["begun"], deque(one["scans"]), one["odd"])
            for name, one in state["heard"].items()
        }
        self._last = {pair: list(one) for pair, one in state["last"].items()}
        self._window, self._done = dict(state["window"]), state["done"]
        self._drift.set_state(state["drift"])
        if self._window:
            self._begin_work()
            assert self._work is not None
            for _ in range(self._done):
                next(self._work)


def _same(one: Sequence[float], other: Sequence[float]) -> bool:
    """Whether two comparisons, each a lag and its standard deviation (s), say the same."""
    bound_s = max(_SAME_S, _SAME_STD * math.hypot(one[1], other[1]))
    return abs(one[0] - other[0]) <= min(bound_s, LEAST_S)


def _due_s(compared: int) -> float:
    """When sensors are compared that have been so often (s, of their own times)."""
    if compared < _EARLY:
        return _FIRST_S * (compared + 1)
    due_s = step_s = _FIRST_S * _EARLY
    for _ in range(compared - _EARLY + 1):
        due_s += step_s
        step_s = min(2.0 * step_s, _MOST_BETWEEN_S)
    return due_s


def _compare_all(
    window: Mapping[str, Sequence[Scan]], settled: Sequence[str], again: bool
) -> Generator[None, None, tuple[str, _Compared]]:
    """Compare each sensor whose clock is not known with that of most boxes, one that is known if any is."""
    recordings = {}
    for name, scans in window.items():
        recordings[name] = Detections.from_scans(scans)
        yield
    among = [name for name in recordings if name in settled] or list(recordings)
    reference = max(among, key=lambda name: len(recordings[name]))
    compared: _Compared = {}
    for name, recording in recordings.items():
        if name != reference and name not in settled:
            pair = (reference, name)
            compared[name] = yield from compare_in_steps(
                recordings[reference], recording, pair, _COMPARED_S, exactly=again
            )
    return reference, compared
