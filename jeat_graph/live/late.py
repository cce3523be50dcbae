"""Scans in order of arrival, tracked as if they had come in order of time.

A tracker keeps a snapshot of its arrays before each of its latest steps. A scan that comes late goes to the
place where it belongs: the state before that place is restored and the scans since are taken again. Scans of
one time are taken jointly, whenever they came. So the state is that of tracking in order of time, to the last
bit, and so are the smoothed trajectories: the smoothers get a step only when nothing can come before.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from jeat_graph.config.schema import Config, SensorConfig
from jeat_graph.data.arrays import FloatArray, RecordArray
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import ConfigError, DataError, TimeOrderError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.live.arrival import Admitted, Arrival, Taken, scanned_last
from jeat_graph.live.clock_steps import ClockSteps, Judged
from jeat_graph.live.clock_watch import ClockNews, ClockWatch
from jeat_graph.live.lateness import LatenessCounter
from jeat_graph.live.repetition import Repetition
from jeat_graph.live.rewinding import ReplayableStep, Rewinding
from jeat_graph.live.time_base import Decision, TimeBase
from jeat_graph.live.waiting import Released, WaitingRoom, by_time
from jeat_graph.rig.common_picture import CommonPicture
from jeat_graph.tracking.checkpoint import load_state, save_state
from jeat_graph.tracking.damage import refusing_damage
from jeat_graph.tracking.one_at_a_time import OneAtATime, one_at_a_time
from jeat_graph.tracking.pending_step import PendingStep
from jeat_graph.tracking.prediction import Prediction
from jeat_graph.tracking.scans import ScanLike, as_scans
from jeat_graph.tracking.tracker import Tracker

REWIND, SKIP, REFUSE = "rewind", "skip", "refuse"
#: A difference of two times is only so exact (s).
_ROUNDING_S = 1e-6
#: So much longer than a slow sensor usually needs its scans are waited for (s).
_JITTER_S = 0.5
POLICIES = (REWIND, SKIP, REFUSE)


def check_saved(tracker: Tracker, what: str) -> None:
    """Refuse a checkpoint, called `what`, of a tracker that is not saved.

    Raises:
        ConfigError: the tracker's engine keeps no state.
    """
    if tracker.not_saved_with is not None:
        raise ConfigError(f"{what} does not go with {tracker.not_saved_with}: it is not saved")


@one_at_a_time("causal appearance_of step save predict drain_smoothed finish")
class LiveTracker(OneAtATime):
    """A tracker that takes scans in the order in which they arrive.

    Threads that share one wait for each other. Copies are trackers of their own, with one that they step.

    Args:
        tracker: a tracker, new or loaded; from now on it is stepped by this object alone.
        policy: what is done with a scan that is older than the newest: `rewind` puts it where it belongs, if
            it is not later than `live.late_s` (or its sensor's `late_s`) allows; `skip` passes it over;
            `refuse` raises.

    Attributes:
        tracker: the tracker.
        lateness: how late scans came, by sensor.
        measured: times of the steps of the last arrival and what they gave to the tracks, if the tracker has
            diagnostics and no step can be taken again.
    """

    def __init__(self, tracker: Tracker, policy: str = REWIND) -> None:
        if policy not in POLICIES:
            raise ConfigError(f"{policy!r} is not one of {', '.join(POLICIES)}")
        config = tracker.config
        if config.pair_within_s:
            raise ConfigError("paper.pair_within_s: whoever gives the scans pairs them (`stream --joint`)")
        if tracker.keeps_recording:
            raise ConfigError("smoother.identities: 'whole' needs the whole recording, in order of time")
        tracker.forget_links()
        self.tracker = tracker
        self.policy = policy
        self.lateness = LatenessCounter()
        self.measured: list[tuple[float, RecordArray]] = []
        self._base = TimeBase(config.live.jump_s)
        self._repetition = Repetition(self._base, whole=tracker.time is None)
        self._rewinding = Rewinding(tracker)
        tracker.logs_assigned = policy == REWIND
        # Where nothing is taken again: sensors of the newest scans, and what the smoothers are to know.
        self._newest = scanned_last(tracker)
        self._due: list[PendingStep | None] = []
        # Of a tracker that has taken scans: to before its time nobody can go back.
        self._begun = -math.inf if tracker.time is None else tracker.time, self._newest
        self._common = CommonPicture.of(config)
        self._clocks = ClockWatch(config)
        self._clock_steps = ClockSteps(config.live.late_s)
        self._room: WaitingRoom | None = None
        # Of the sensors that are declared or have been met: known delay of their times, most lateness (s).
        self._latency: dict[str, float] = {}
        self._late_s: dict[str, float] = {}
        self._keep_s = 0.0  # steps that are older than the newest by more are never taken again
        for name in config.sensors:
            self._know(name)

    @property
    def time(self) -> float | None:
        """Time of the newest scan (s), or None before the first."""
        return self.tracker.time

    @property
    def steps(self) -> list[ReplayableStep]:
        """The steps that may still be taken again, by time."""
        return self._rewinding.steps

    @property
    def clocks(self) -> dict[str, dict[str, float]]:
        """What was found of the sensors' clocks and is taken off their times: `lag_s`, `std_s`, `at_s`."""
        return self._clocks.clocks

    @property
    def replayed(self) -> int:
        """How many steps have been taken again so far."""
        return self._rewinding.replayed

    def causal(self) -> Trajectories:
        """Return the tracks that are reported now, by the identities that were given out for them."""
        return self._rewinding.identities.rename(self.tracker.causal())

    def appearance_of(self, identity: int) -> FloatArray | None:
        """Return what a living track looks like by the identity given out (`Tracker.appearance_of`)."""
        return self.tracker.appearance_of(self._rewinding.identities.own_of(identity))

    def step(self, scans: ScanLike | Sequence[ScanLike]) -> Arrival:
        """Take in one scan, or several of one time, which have just arrived.

        Args:
            scans: as `Tracker.step`; their times are the measurement's own, but for the sensor's `latency_s`
                and `clock`, and for what is found of its clock while scans come (`clocks`).

        Raises:
            DataError, UnknownSensorError: as `Tracker.step`; the state is as before.
            TimeOrderError: a scan comes late, and late scans are refused.
        """
        given = as_scans(scans)
        self._meet(given)  # sensors are refused before anything is done
        given = [self._corrected(self._common.scan(scan)) for scan in given]
        batch = [self._on_common_clock(scan) for scan in given]
        self.measured = []
        repeated, late, new = self._repetition.sort(batch, given, self._was_taken)
        judged = self._judge(new)
        on = [*judged.released, *judged.take]
        released = Released([*by_time(judged.released), *([judged.take] if judged.take else [])], [])
        if self._room is not None:
            released = self._room.enter(on, self._base.bound_s)
        admitted = [self._admit(scans) for scans in released.batches]
        self._repetition.note(given)  # what the tracker refuses has not come
        missed = [*released.missed, *late]
        for scan in missed:
            self.lateness.add(scan.sensor, max((self.time or 0.0) - scan.t, 0.0), True)
        news = self._clocks.saw([*on, *late])
        if news is not None and news.taken_off:
            for name, found in news.taken_off.items():
                self._clock_steps.corrected(name, found.lag_s)
            news.lines.extend(self._wait_for(news))
        waiting = [] if self._room is None else [scan for scan in on if self._room.holds(scan)]
        arrival = self._arrival(admitted, repeated)
        return arrival._replace(
            held=[*arrival.held, *judged.held],
            refuted=[*judged.refuted, *arrival.refuted],
            waiting=waiting,
            missed=missed,
            clocks=self._text_of_steps(judged, news),
        )

    def _judge(self, scans: list[Scan]) -> Judged:
        """Look whether a clock has stepped; where late scans are refused, times are as they are."""
        if self.policy == REFUSE or self.tracker.config.input.clocks != "find" or not scans:
            return Judged(scans, [], [], [])
        judged = self._clock_steps.saw(scans)
        for scan in judged.refuted:
            self.lateness.add(scan.sensor, 0.0, True)
        return judged

    def _text_of_steps(self, judged: Judged, news: ClockNews | None) -> ClockNews | None:
        """Take steps of clocks off from now on, and add what is to be reported of them to the other news."""
        if judged.together:
            line = f"warning: the clock of all sensors was set back by {judged.together:.3f} s"
            news = news or ClockNews({}, {}, [])
            news.lines.append(line)
        for step in judged.steps:
            found = self._clocks.stepped(*step)
            news = news or ClockNews({}, {}, [])
            news.taken_off[step.sensor] = found
            news.lines.append(
                f"warning: sensor {step.sensor!r}: its clock has leapt by {step.step_s:+.3f} s while the "
                f"others went on; that is taken off, {self._clocks.lag_s(step.sensor):.4f} s in all "
                "(--set input.clocks=as_given leaves them)"
            )
        return news

    def _admit(self, scans: list[Scan]) -> Admitted:
        """Take in scans that need not wait, as far as their times are believed."""
        before = self.tracker.time
        decision = self._decide(scans, before)
        taken = self._take_all(decision.take)
        self.lateness.arrived(taken, decision.refuted, before)
        now = self.tracker.time
        self._hand_over(now)
        if any(one.good for one in taken) and not (decision.leapt or decision.reset):
            self._base.took(before, now)
        return Admitted(scans, decision, taken, now or 0.0, self._answer())

    def _answer(self) -> Trajectories:
        table = self.tracker.causal()
        return self._rewinding.identities.answer(table) if self.policy == REWIND else table

    def _arrival(self, admitted: list[Admitted], repeated: list[Scan]) -> Arrival:
        taken = [one for part in admitted for one in part.taken]
        decisions = [part.decision for part in admitted]
        return Arrival(
            admitted[-1].table if admitted else self._answer(),
            self.tracker.time or 0.0,
            late_s=admitted[-1].late_s if admitted else 0.0,
            dropped=[scan for one in taken for scan in one.dropped],
            repeated=repeated,
            held=[scan for part in admitted if not part.decision.take for scan in part.scans],
            refuted=[scan for one in decisions for scan in one.refuted],
            reset=any(one.reset for one in decisions),
            leapt=any(one.leapt for one in decisions),
            taken=[scan for one in taken for scan in one.good],
            earlier=[(part.t, part.table, part.late_s) for part in admitted[:-1] if part.taken],
        )

    def _wait_for(self, news: ClockNews) -> list[str]:
        """Have scans wait for sensors whose clocks were found, and whose scans come too late to go back."""
        newest = {
            name: t - (news.taken_off[name].lag_s if name in news.taken_off else 0.0)
            for name, t in news.newest.items()
        }
        behind = {name: max(newest.values()) - t for name, t in newest.items()}
        back_s = self._back_s()
        slow = {name: newest[name] for name in news.taken_off if behind[name] > back_s}
        if not slow:
            return []
        names = ", ".join(repr(name) for name in sorted(slow))
        late_s, most_s = max(behind[name] for name in slow), self.tracker.config.live.wait_s
        if late_s > most_s:
            return [
                f"scans of {names} come {late_s:.2f} s later than others of the same time, which is more "
                f"than answers wait (live.wait_s is {most_s:g}): they are passed over"
            ]
        begun_s = -math.inf if self.time is None else self.time
        room = WaitingRoom(slow, late_s + _JITTER_S, begun_s, back_s)
        self._room = room if self._room is None else room.beside(self._room)
        return [
            f"scans of {names} come {late_s:.2f} s later than others of the same time: from now on answers "
            "wait for them (--set live.wait_s=0 passes them over instead)"
        ]

    def _back_s(self) -> float:
        """How far the tracker goes back for any sensor (s)."""
        return min(self._late_s.values(), default=0.0) if self.policy == REWIND else 0.0

    def _take_all(self, batch: list[Scan]) -> list[Taken]:
        """Take in scans of any times, all or none."""
        if len(batch) == 1:
            return [self._take(batch)]
        times = sorted({scan.t for scan in batch})
        mark = (self._rewinding.mark(), self._newest) if len(times) > 1 else None
        try:
            return [self._take([scan for scan in batch if scan.t == t]) for t in times]
        except Exception:
            if mark is not None:  # a later one was refused: the earlier ones have not come either
                self._rewinding.go_back(mark[0])
                self._newest, self._due, self.measured = mark[1], [], []
            raise

    def _decide(self, batch: list[Scan], now: float | None) -> Decision:
        """Decide what becomes of scans that have not come before, and let time start over where it must."""
        t = max([scan.t for scan in batch])
        if self._repetition.first is None:
            self._repetition.first = t
        if now is not None and t < now and self.policy == REFUSE:
            return Decision(batch, [])
        late = not any(self._may_come(scan, now) for scan in batch)
        last_scan = {}
        if late or not self._base.near(t, now):
            last_scan = self.tracker.last_scans()
        decision = self._base.decide(batch, now, late, last_scan)
        if decision.leapt or decision.reset:
            self._repetition.begins()
            if self._room is not None:  # what waits is of the time before
                self._take_all(self._room.clear())
                self._room.jumped(t)
        if decision.reset:
            self._rewinding.settle(math.inf)
            self._rewinding.settled, self._newest, self._begun = -math.inf, [], (-math.inf, [])
            first = min(scan.t for scan in decision.take)
            self._repetition.begins(first)
            self.tracker.reset(first)
        return decision

    def save(self, path: str | Path, more: dict[str, Any] | None = None) -> None:
        """Write the whole state to a file, for `load` to go on from (see `Tracker.save`).

        Args:
            path: the file.
            more: plain data to be kept with it.

        Raises:
            ConfigError: the engine keeps no checkpoints.
        """
        check_saved(self.tracker, "a checkpoint")
        # The state before the steps that may be taken again, and their scans: the rest follows from these.
        state = self.tracker.state(self.steps[0].before if self.steps else None)
        state |= {
            "policy": self.policy,
            "rewinding": self._rewinding.state(),
            "base": self._base.state() | self._repetition.state(),
            "newest": self._newest,
            "lateness": self.lateness.state(),
            "clocks": self._clocks.state(),
            "clock_steps": self._clock_steps.state(),
            "waiting": None if self._room is None else self._room.state(),
            "more": more or {},
        }
        save_state(path, self.tracker.config, state)

    @staticmethod
    def load(path: str | Path, config: Config | None = None) -> tuple[LiveTracker, dict[str, Any]]:
        """Return the tracker that was saved to a file, and the data kept with it.

        Args:
            path: the file.
            config: the configuration that it must have had; None takes the file's.

        Raises:
            DataError: no such file, or one that holds no such tracker.
            JeatGraphError: it was saved by another version, or with other settings.
        """
        kept, state = load_state(path, config)
        if "policy" not in state:
            raise DataError("holds a tracker, but not one that takes late scans", path)
        with refusing_damage(path):
            live = LiveTracker(Tracker.from_state(kept, state), state["policy"])
            live._newest = state["newest"]
            live.lateness.set_state(state["lateness"])
            live._rewinding.set_state(state["rewinding"])
            live._base.set_state(state["base"])
            live._clocks.set_state(state["clocks"])
            live._clock_steps.set_state(state["clock_steps"])
            newest = live.tracker.time
            if state["waiting"] is not None:
                live._room = WaitingRoom.of_state(state["waiting"])
                newest = live._room.newest_s
            live._repetition.set_state(state["base"], newest)
            return live, state["more"]

    def predict(self, t: float) -> Prediction:
        """Say where the tracks will be at a time not before the newest scan's (see `Tracker.predict`)."""
        return self._rewinding.identities.rename(self.tracker.predict(t))

    def drain_smoothed(self) -> Trajectories:
        """Return the smoothed rows that are final and forget them (see `Tracker.drain_smoothed`)."""
        return self.tracker.drain_smoothed()

    def finish(self) -> Trajectories:
        """End all tracks and return the smoothed rows not drained yet (see `Tracker.finish`).

        Scans that wait are taken, those ahead of time too: nothing comes any more that could prove them
        wrong.
        """
        doubted = self._clock_steps.clear()
        if doubted:
            self._take_all(doubted)
            self._hand_over(self.time)
        if self._room is not None:
            self._take_all(self._room.clear())
            self._hand_over(self.time)
        held = self._base.clear()
        if held and self.tracker.time is not None and min(scan.t for scan in held) > self.tracker.time:
            self._take_all(held)
            self._hand_over(self.time)
        self._rewinding.settle(math.inf)
        return self.tracker.finish()

    def _meet(self, scans: Sequence[Scan]) -> None:
        """Refuse sensors that are not declared and may not be; know those that look for the first time."""
        self.tracker.meet(scans)
        for scan in scans:
            if scan.sensor not in self._late_s:
                self._know(scan.sensor)

    def _know(self, sensor: str) -> None:
        """Go by what the configuration says of a sensor, or by what it says of those that nobody declared."""
        config = self.tracker.config
        declared = config.sensors.get(sensor, SensorConfig())
        self._latency[sensor] = declared.latency_s
        self._late_s[sensor] = config.live.late_s if declared.late_s is None else declared.late_s
        if self.policy == REWIND:
            self._keep_s = max(self._keep_s, self._late_s[sensor] + 2.0 * _ROUNDING_S)

    def _corrected(self, scan: Scan) -> Scan:
        latency = self._latency[scan.sensor]
        return replace(scan, t=scan.t - latency) if latency else scan

    def _on_common_clock(self, scan: Scan) -> Scan:
        """Take off a scan's time what was found of its sensor's clock."""
        lag_s = self._clocks.lag_s(scan.sensor)
        return replace(scan, t=scan.t - lag_s) if lag_s else scan

    def _take(self, batch: list[Scan]) -> Taken:
        """Take in scans of one time, but those that are to be passed over."""
        t, now = batch[0].t, self.tracker.time
        late_s = 0.0 if now is None else max(now - t, 0.0)
        if late_s > 0.0 and self.policy == REFUSE:
            raise TimeOrderError(
                f"scan at t = {t} s is older than the last one at {now} s, and late scans are refused"
            )
        good: dict[str, Scan] = {}
        dropped = []
        for scan in batch:
            if scan.sensor not in good and self._may_come(scan, now):
                good[scan.sensor] = scan
            else:
                dropped.append(scan)
        if good:
            self._insert(list(good.values()))
        return Taken(list(good.values()), dropped, late_s)

    def _was_taken(self, scan: Scan) -> bool:
        """Whether a scan of that sensor and of that time, which is not after the newest, has been taken."""
        if self._room is not None and self._room.holds(scan):
            return True
        if self.policy != REWIND:
            return (self.time is not None and scan.t < self.time) or scan.sensor in self._newest
        return scan.t <= self._rewinding.settled or self._rewinding.knows(scan)

    def _may_come(self, scan: Scan, now: float | None) -> bool:
        """Whether a scan can be taken at a time (s): it is not late, and its sensor gave none of it."""
        if now is None:
            return True
        if self.policy != REWIND:
            return scan.t > now or (scan.t == now and scan.sensor not in self._newest)
        if now - scan.t > self._late_s[scan.sensor] + _ROUNDING_S or scan.t <= self._rewinding.settled:
            return False
        begun, by = self._begun
        if scan.t < begun or (scan.t == begun and scan.sensor in by):
            return False
        return not self._rewinding.knows(scan)

    def _insert(self, scans: list[Scan]) -> None:
        """Take in scans of one time, each of another sensor."""
        if self.policy == REWIND:
            self._rewinding.insert(scans)
            return
        earlier = self._newest if scans[0].t == self.tracker.time else []
        self._due.append(self.tracker.take_in(scans))
        self._newest = earlier + [scan.sensor for scan in scans]
        if self.tracker.has_diagnostics:
            self.measured.append((scans[0].t, self.tracker.last_measurements()[0]))

    def _hand_over(self, now: float | None) -> None:
        """Tell the smoothers of all that cannot be taken again at a time (s)."""
        for taken in self._due:
            self.tracker.hand_over(taken)
        self._due = []
        if self.policy == REWIND and now is not None:
            self._rewinding.settle(now - self._keep_s)
