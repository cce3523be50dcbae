"""Sees a sensor's clock step: its own intervals jump, while the scans of the others go on as before.

A pause and a step look the same in one sensor's times. They differ in what arrives meanwhile: in a pause of
one sensor, or of all, the others' times go on by as much; when a clock steps they do not. So the others are
the clock by which a sensor's own intervals are judged, and the clock on the wall is never asked.

==========================  ==========================================================================
a scan                      what is done
==========================  ==========================================================================
jumps ahead                 held, and those behind it, until others tell which it was (at most a second)
… others go on as before    the clock stepped: the jump is taken off its times from here on
… others jump as far        all paused: the held ones are taken as they are
… its next ones do not      that one time was wrong: passed over
goes back                   taken as one that comes late; five in a row are a step, as above
==========================  ==========================================================================
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from statistics import median
from typing import Any, NamedTuple

from jeat_graph.data.detections import Scan

#: Smaller jumps are no steps (s), nor are those shorter than so many of the sensor's long intervals.
_LEAST_S, _LONG = 0.08, 4.0
#: Intervals of a sensor that are remembered, and how many must be for it to have a rhythm.
_KEPT, _RHYTHM = 16, 8
#: A step is believed after so many scans of its sensor, ahead or back, and so many of others.
_AHEAD, _BACK, _OTHERS = 3, 5, 2
#: Back, but not farther than scans may come late: after so many.
_BACK_LATE = 25
#: The others have jumped too where they went on by this share of the jump.
_SHARE = 0.5
#: ... and after so long (s of its own times) in which another went on beside it, to this (s), or to so many
#: of the other's intervals. Who has a backlog, as after a broker's failure, catches up: no witness meanwhile.
_BESIDE_S, _EVEN_S, _EVEN_INTERVALS = 0.3, 0.05, 1.5
#: Nobody is held for longer than this (s of its own times), or than so many intervals of a witness.
_HELD_S, _HELD_INTERVALS = 1.0, 6.0


class ClockStep(NamedTuple):
    """A clock that stepped.

    Attributes:
        sensor: whose.
        step_s: by how much it is ahead now beside before (s).
        std_s: how exactly that is known (s): as its own intervals vary.
        at_s: the sensor's time before it (s).
    """

    sensor: str
    step_s: float
    std_s: float
    at_s: float


class Judged(NamedTuple):
    """What becomes of the scans of a message.

    Attributes:
        take: scans of the message that go on.
        held: those of the message that wait.
        refuted: scans that were held, and whose times were wrong.
        steps: clocks that stepped, whose scans in `take` and `released` have times without that already.
        together: by how much all clocks went back at once (s), or 0.
        released: scans of earlier messages that were held and go on now.
    """

    take: list[Scan]
    held: list[Scan]
    refuted: list[Scan]
    steps: list[ClockStep]
    together: float = 0.0
    released: Sequence[Scan] = ()


@dataclass
class _Rhythm:
    """How a sensor's own times go on: its newest and its first (s), and its last intervals (s)."""

    newest: float
    begun: float
    intervals: deque[float] = field(default_factory=lambda: deque(maxlen=_KEPT))

    @property
    def usual(self) -> float:
        """The usual interval (s)."""
        return median(self.intervals)

    @property
    def jump(self) -> float:
        """What is longer is no interval of this sensor (s); the longest of all may be an exception."""
        return max(_LEAST_S, _LONG * sorted(self.intervals)[-2])

    @property
    def known(self) -> bool:
        """Whether there is a rhythm."""
        return len(self.intervals) >= _RHYTHM


@dataclass
class _Doubt:
    """A sensor whose time has jumped, and of which it is not known yet why.

    Attributes:
        before: its time before that (s).
        first: its first time after it (s).
        newest: its newest (s).
        marks: times of the others when it jumped (s).
        count: its scans since.
        others: scans of others since.
        held: scans that wait.
        beside: by sensor since when it goes on beside this one (s), and how far it was ahead since, at least
            and at most (s).
    """

    before: float
    first: float
    newest: float
    marks: dict[str, float]
    count: int = 1
    others: int = 0
    held: list[Scan] = field(default_factory=list)
    beside: dict[str, tuple[float, float, float]] = field(default_factory=dict)

    @property
    def jump(self) -> float:
        """By how much it jumped (s)."""
        return self.first - self.before


class ClockSteps:
    """Watches the rhythm of each sensor.

    Args:
        late_s: so late a scan may come and still be taken (s).
    """

    def __init__(self, late_s: float) -> None:
        self._late_s = late_s
        self._rhythms: dict[str, _Rhythm] = {}
        self._marks: dict[str, dict[str, float]] = {}  # by sensor, the others' times at its last scan
        self._doubts: dict[str, _Doubt] = {}

    def saw(self, scans: Sequence[Scan]) -> Judged:
        """Judge the scans of one message, of sensors that each occur once.

        Args:
            scans: their times are without all that is known of the sensors' clocks.
        """
        take: list[Scan] = []
        held: list[Scan] = []
        refuted: list[Scan] = []
        fresh: list[Scan] = []
        for scan in scans:  # first all that only go on: they are witnesses of the others
            if scan.sensor not in self._doubts and not self._jumps(scan):
                self._goes_on(scan)
                take.append(scan)
            else:
                fresh.append(scan)
        if not fresh and not self._doubts:
            return Judged(take, [], [], [])
        for scan in fresh:
            doubt = self._doubts.get(scan.sensor)
            if doubt is None:
                doubt = self._begin(scan)
                if doubt is None:
                    self._accept(scan)
                    take.append(scan)
                    continue
            elif abs(scan.t - doubt.newest) <= self._rhythms[scan.sensor].jump:
                doubt.count, doubt.newest = doubt.count + 1, scan.t
            else:  # the time before goes on, or another begins: what was held is of neither
                refuted += doubt.held
                del self._doubts[scan.sensor]
                if self._jumps(scan):
                    self._accept(scan)
                else:
                    self._goes_on(scan)
                take.append(scan)
                continue
            self._compare_beside(doubt)
            if doubt.jump > 0.0:
                doubt.held.append(scan)
                held.append(scan)
            else:
                take.append(scan)
        steps, released, together = self._decide()
        corrected = _corrected(steps)
        of_now = [scan for scan in held if any(scan is one for one in released)]
        earlier = [scan for scan in released if not any(scan is one for one in of_now)]
        return Judged(
            [corrected(scan) for scan in [*of_now, *take]],
            [scan for scan in held if not any(scan is one for one in of_now)],
            refuted,
            steps,
            together,
            [corrected(scan) for scan in earlier],
        )

    def corrected(self, sensor: str, lag_s: float) -> None:
        """Note that so much more (s) is taken off a sensor's times from now on, which is no step."""
        rhythm = self._rhythms.get(sensor)
        if rhythm is None:
            return
        rhythm.newest, rhythm.begun = rhythm.newest - lag_s, rhythm.begun - lag_s
        for marks in (*self._marks.values(), *(doubt.marks for doubt in self._doubts.values())):
            if sensor in marks:
                marks[sensor] -= lag_s
        for one in self._doubts.values():
            one.beside.clear()
        doubt = self._doubts.get(sensor)
        if doubt is not None:
            doubt.before, doubt.first = doubt.before - lag_s, doubt.first - lag_s
            doubt.newest -= lag_s
            doubt.held = [replace(scan, t=scan.t - lag_s) for scan in doubt.held]

    def clear(self) -> list[Scan]:
        """Return all that are held, and hold none any more."""
        held = [scan for doubt in self._doubts.values() for scan in doubt.held]
        self._doubts.clear()
        return held

    def _jumps(self, scan: Scan) -> bool:
        rhythm = self._rhythms.get(scan.sensor)
        if rhythm is None or not rhythm.known:
            return False
        return abs(scan.t - rhythm.newest) > rhythm.jump

    def _goes_on(self, scan: Scan) -> None:
        """Take note of a scan that follows, or comes a little late."""
        rhythm = self._rhythms.get(scan.sensor)
        if rhythm is None:
            rhythm = self._rhythms[scan.sensor] = _Rhythm(scan.t, scan.t)
        elif scan.t > rhythm.newest:
            rhythm.intervals.append(scan.t - rhythm.newest)
            rhythm.newest = scan.t
        self._marks[scan.sensor] = self._others(scan.sensor)
        for name, doubt in self._doubts.items():
            doubt.others += name != scan.sensor

    def _others(self, sensor: str) -> dict[str, float]:
        return {name: one.newest for name, one in self._rhythms.items() if name != sensor}

    def _begin(self, scan: Scan) -> _Doubt | None:
        """Doubt a sensor, if there is anybody who could tell a step from a pause."""
        rhythm, marks = self._rhythms[scan.sensor], self._marks.get(scan.sensor, {})
        jump = scan.t - rhythm.newest
        witnesses = [
            name
            for name, one in self._rhythms.items()
            if name != scan.sensor and one.known and one.usual < _SHARE * abs(jump)
        ]
        if jump > 0.0 and (not witnesses or self._went_on(marks, witnesses) >= _SHARE * jump):
            return None
        doubt = _Doubt(rhythm.newest, scan.t, scan.t, self._others(scan.sensor))
        self._doubts[scan.sensor] = doubt
        return doubt

    def _went_on(self, marks: Mapping[str, float], names: Sequence[str]) -> float:
        """By how much (s) the others went on since they had these times, or since they began: the most."""
        ones = {name: self._rhythms[name] for name in names}
        return max((one.newest - marks.get(name, one.begun) for name, one in ones.items()), default=0.0)

    def _accept(self, scan: Scan) -> None:
        """Let a sensor go on from another time."""
        self._rhythms[scan.sensor].newest = scan.t
        self._marks[scan.sensor] = self._others(scan.sensor)

    def _decide(self) -> tuple[list[ClockStep], list[Scan], float]:
        """Decide what can be decided: steps, scans that wait no longer, how far all went back at once."""
        steps: list[ClockStep] = []
        released: list[Scan] = []
        together = 0.0
        known = [name for name, one in self._rhythms.items() if one.known]
        all_back = all(name in self._doubts and self._doubts[name].jump < 0.0 for name in known)
        if all_back and known and min(self._doubts[name].count for name in known) >= _BACK:
            together = -median(self._doubts[name].jump for name in known)
        doubts = dict(self._doubts)
        for name, doubt in doubts.items():
            others = [other for other in known if other != name]
            if together or self._paused(doubt, others, doubts):
                released += doubt.held
                self._close(name, doubt, 0.0)
            elif self._settled(doubt, others):
                step = self._step(name, doubt, others)
                steps.append(step)
                released += doubt.held
                self._close(name, doubt, step.step_s)
            elif self._long(doubt, others):
                if doubt.jump < 0.0 and doubt.count >= _BACK:
                    together = -doubt.jump
                released += doubt.held
                self._close(name, doubt, 0.0)
        return steps, released, together

    def _paused(self, doubt: _Doubt, others: Sequence[str], doubts: Mapping[str, _Doubt]) -> bool:
        """Whether the others have jumped ahead as well."""
        if doubt.jump < 0.0 or not others:
            return False
        if all(other in doubts and doubts[other].jump > 0.0 for other in others):
            return True
        since = doubt.newest - doubt.first
        return any(
            self._went_on(doubt.marks, [other]) - since - 0.5 * self._rhythms[other].usual
            >= _SHARE * doubt.jump
            for other in others
        )

    def _settled(self, doubt: _Doubt, others: Sequence[str]) -> bool:
        """Whether the sensor goes on beside another as if nothing had been but the jump."""
        if doubt.count < self._enough(doubt) or doubt.others < _OTHERS:
            return False
        return doubt.jump < 0.0 or any(
            doubt.newest - doubt.beside[other][0] >= _BESIDE_S for other in others if other in doubt.beside
        )

    def _compare_beside(self, doubt: _Doubt) -> None:
        """Note since when each of the others has gone on as this sensor does."""
        for name, one in self._rhythms.items():
            if name in doubt.marks and one.known:
                ahead = one.newest - doubt.newest
                since, least, most = doubt.beside.get(name, (doubt.newest, ahead, ahead))
                least, most = min(least, ahead), max(most, ahead)
                if most - least > max(_EVEN_S, _EVEN_INTERVALS * one.usual):
                    since, least, most = doubt.newest, ahead, ahead
                doubt.beside[name] = (since, least, most)

    def _enough(self, doubt: _Doubt) -> int:
        """So many scans make a step; where scans may come as late as that, it takes many."""
        if doubt.jump > 0.0:
            return _AHEAD
        return _BACK if -doubt.jump > self._late_s else _BACK_LATE

    def _long(self, doubt: _Doubt, others: Sequence[str]) -> bool:
        """Whether nobody is going to tell."""
        if doubt.jump < 0.0 and -doubt.jump <= self._late_s and doubt.count < _BACK_LATE:
            return False
        usual = max((self._rhythms[other].usual for other in others), default=0.0)
        # By the others' times too: a sensor that says no more after a jump would be held for ever.
        waited = max(doubt.newest - doubt.first, self._went_on(doubt.marks, others))
        return waited > max(_HELD_S, _HELD_INTERVALS * usual)

    def _step(self, name: str, doubt: _Doubt, others: Sequence[str]) -> ClockStep:
        rhythm = self._rhythms[name]
        # Usually no scan is lost at a step; where some were, the others tell how long that took.
        since = doubt.newest - doubt.first
        passed = self._went_on(self._marks.get(name, {}), others) - since
        passed = passed if passed > rhythm.jump else rhythm.usual
        spread = max(abs(one - rhythm.usual) for one in rhythm.intervals)
        return ClockStep(name, round(doubt.jump - passed, 6), round(max(spread, 1e-4), 6), doubt.before)

    def _close(self, name: str, doubt: _Doubt, step_s: float) -> None:
        del self._doubts[name]
        self._rhythms[name].newest = doubt.newest - step_s
        self._marks[name] = self._others(name)

    def state(self) -> dict[str, Any]:
        """Return plain data, for `set_state`."""
        return {
            "rhythms": {
                name: [one.newest, one.begun, list(one.intervals)] for name, one in self._rhythms.items()
            },
            "marks": self._marks,
            "doubts": {name: dict(vars(one)) for name, one in self._doubts.items()},
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go on from what `state` returned."""
        self._rhythms = {
            name: _Rhythm(newest, begun, deque(intervals, maxlen=_KEPT))
            for name, (newest, begun, intervals) in state["rhythms"].items()
        }
        self._marks = {name: dict(marks) for name, marks in state["marks"].items()}
        self._doubts = {name: _Doubt(**one) for name, one in state["doubts"].items()}


def _corrected(steps: Sequence[ClockStep]) -> Callable[[Scan], Scan]:
    """What takes the steps off the times of scans."""
    taken_off = {step.sensor: step.step_s for step in steps}

    def corrected(scan: Scan) -> Scan:
        step_s = taken_off.get(scan.sensor)
        return scan if step_s is None else replace(scan, t=scan.t - step_s)

    return corrected
