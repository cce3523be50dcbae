"""Scans in order of arrival, tracked as if they had come in order of time.

A tracker keeps a snapshot of its arrays before each of its latest steps. A scan that comes late goes to the
place where it belongs: the state before that place is restored and the scans since are taken again. Scans of
one time are taken jointly, whenever they came. So the state is that of tracking in order of time, to the last
bit, and so are the smoothed trajectories: the smoothers are told of a step only when nothing can come before.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import RecordArray
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import ConfigError, DataError, TimeOrderError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.live.lateness import LatenessCounter
from jeat_graph.tracking.checkpoint import load_state, save_state
from jeat_graph.tracking.prediction import Prediction
from jeat_graph.tracking.scans import ScanLike, as_scans, sensor_index
from jeat_graph.tracking.snapshot import Snapshot
from jeat_graph.tracking.step_record import StepRecord
from jeat_graph.tracking.tracker import Tracker

REWIND, SKIP, REFUSE = "rewind", "skip", "refuse"
#: A difference of two times is only so exact (s).
_ROUNDING_S = 1e-6
POLICIES = (REWIND, SKIP, REFUSE)


@dataclass
class TakenStep:
    """A step that may still be taken again.

    Attributes:
        t: its time (s).
        scans: its scans, sensors in alphabetical order.
        before: the tracker's state before it.
        taken: what the smoothers are to be told of it.
    """

    t: float
    scans: list[Scan]
    before: Snapshot
    taken: StepRecord | None


class Arrival(NamedTuple):
    """What became of scans that arrived.

    Attributes:
        table: the tracks that are reported now.
        t: time of the newest step (s): that of the table.
        late_s: how much older the scans were than the newest before them (s), 0 for scans in order.
        dropped: those that were passed over: too late, or of a sensor that has given one of that time.
        repeated: those that had been taken before a checkpoint from which the tracker went on.
    """

    table: Trajectories
    t: float
    late_s: float
    dropped: list[Scan]
    repeated: list[Scan]


class LiveTracker:
    """A tracker that takes scans in the order in which they arrive.

    Args:
        tracker: a tracker, new or loaded; from now on it is stepped by this object alone.
        policy: what is done with a scan that is older than the newest: `rewind` puts it where it belongs, if
            it is not later than `live.late_s` (or its sensor's `late_s`) allows; `skip` passes it over;
            `refuse` raises.

    Attributes:
        tracker: the tracker.
        lateness: how late scans came, by sensor.
        steps: the steps that may still be taken again, by time.
        replayed: how many steps have been taken again so far.
        measured: times of the steps of the last arrival and what they gave to the tracks, if the tracker has
            diagnostics and no step can be taken again.
    """

    def __init__(self, tracker: Tracker, policy: str = REWIND) -> None:
        if policy not in POLICIES:
            raise ConfigError(f"{policy!r} is not one of {', '.join(POLICIES)}")
        config = tracker.config
        self.tracker = tracker
        self.policy = policy
        self.lateness = LatenessCounter(tracker.sensor_names)
        self.steps: list[TakenStep] = []
        self.replayed = 0
        self.measured: list[tuple[float, RecordArray]] = []
        self._again_until: float | None = None  # after a restart: time of the newest scan that was known then
        self._newest: list[str] = []  # where nothing is taken again: sensors of the scans at the newest time
        self._settled = -math.inf  # time of the last step that the smoothers have been told of
        self._latency = {name: sensor.latency_s for name, sensor in config.sensors.items()}
        self._late_s = {name: _late_s(config, name) for name in config.sensors}
        self._keep_s = max(self._late_s.values()) + 2.0 * _ROUNDING_S if policy == REWIND else 0.0

    @property
    def time(self) -> float | None:
        """Time of the newest scan (s), or None before the first."""
        return self.tracker.time

    def step(self, scans: ScanLike | Sequence[ScanLike]) -> Arrival:
        """Take in one scan, or several of one time, which have just arrived.

        Args:
            scans: as `Tracker.step`; their times are the measurement's own, but for the sensor's `latency_s`.

        Raises:
            DataError, UnknownSensorError: as `Tracker.step`; the state is as before.
            TimeOrderError: a scan comes late, and late scans are refused.
        """
        batch = [self._corrected(scan) for scan in as_scans(scans)]
        for scan in batch:
            sensor_index(scan.sensor, self.tracker.sensor_names)  # refused before anything is done
        self.measured = []
        now = self.tracker.time
        late_s = 0.0
        repeated = [scan for scan in batch if self._comes_again(scan)]
        batch = [scan for scan in batch if scan not in repeated]
        dropped: list[Scan] = []
        for t in sorted({scan.t for scan in batch}):
            here = [scan for scan in batch if scan.t == t]
            late_s = max(late_s, 0.0 if now is None else now - t)
            dropped += self._take(here)
        return Arrival(self.tracker.causal(), self.tracker.time or 0.0, late_s, dropped, repeated)

    def save(self, path: str | Path, more: dict[str, Any] | None = None) -> None:
        """Write the whole state to a file, for `load` to go on from (see `Tracker.save`).

        Args:
            path: the file.
            more: plain data to be kept with it.

        Raises:
            JeatGraphError: the smoothers are in a process of their own (`smoother.worker`).
        """
        # The state before the steps that may be taken again, and their scans: the rest follows from these.
        state = self.tracker.state(self.steps[0].before if self.steps else None)
        state |= {
            "policy": self.policy,
            "steps": [step.scans for step in self.steps],
            "settled": self._settled,
            "replayed": self.replayed,
            "newest": self._newest,
            "lateness": self.lateness.state(),
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
        live = LiveTracker(Tracker.from_state(kept, state), state["policy"])
        live._settled, live.replayed = state["settled"], state["replayed"]
        live._newest = state["newest"]
        live.lateness.set_state(state["lateness"])
        for scans in state["steps"]:
            before = live.tracker.snapshot()
            taken = live.tracker.take_in(scans)
            live.steps.append(TakenStep(scans[0].t, scans, before, taken))
        live._again_until = live.tracker.time
        return live, state["more"]

    def predict(self, t: float) -> Prediction:
        """Say where the tracks will be at a time not before the newest scan's (see `Tracker.predict`)."""
        return self.tracker.predict(t)

    def drain_smoothed(self) -> Trajectories:
        """Return the smoothed rows that are final and forget them (see `Tracker.drain_smoothed`)."""
        return self.tracker.drain_smoothed()

    def finish(self) -> Trajectories:
        """End all tracks and return the smoothed rows not drained yet (see `Tracker.finish`)."""
        self._settle(float("inf"))
        return self.tracker.finish()

    def _corrected(self, scan: Scan) -> Scan:
        latency = self._latency.get(scan.sensor, 0.0)
        return replace(scan, t=scan.t - latency) if latency else scan

    def _take(self, batch: list[Scan]) -> list[Scan]:
        """Take in scans of one time; return those that were passed over."""
        t, now = batch[0].t, self.tracker.time
        late_s = 0.0 if now is None else max(now - t, 0.0)
        if late_s > 0.0 and self.policy == REFUSE:
            raise TimeOrderError(
                f"scan at t = {t} s is older than the last one at {now} s, and late scans are refused"
            )
        good = [scan for scan in batch if self._may_come(scan, late_s)]
        if good:
            self._insert(good)
        for scan in batch:  # what the tracker refuses has not come
            self.lateness.add(scan.sensor, late_s, scan not in good)
        return [scan for scan in batch if scan not in good]

    def _comes_again(self, scan: Scan) -> bool:
        """Whether a scan was taken before the restart: the input may come again from anywhere before it."""
        if self._again_until is None:
            return False
        if scan.t > self._again_until:
            self._again_until = None  # the first new one: no other of those before can follow
            return False
        if self.policy != REWIND:
            return scan.t < self._again_until or scan.sensor in self._newest
        return scan.t <= self._settled or self._is_known(scan)

    def _is_known(self, scan: Scan) -> bool:
        """Whether the sensor has given a scan of that time which may still be taken again."""
        k = self._place(scan.t)
        known = self.steps[k].scans if k < len(self.steps) and self.steps[k].t == scan.t else []
        return any(other.sensor == scan.sensor for other in known)

    def _may_come(self, scan: Scan, late_s: float) -> bool:
        if self.policy != REWIND:
            return late_s == 0.0
        if late_s > self._late_s[scan.sensor] + _ROUNDING_S or scan.t <= self._settled:
            return False
        return not self._is_known(scan)

    def _place(self, t: float) -> int:
        return bisect_left(self.steps, t, key=lambda step: step.t)

    def _insert(self, scans: list[Scan]) -> None:
        """Put scans of one time where they belong, and take all steps from there on again."""
        if self.policy != REWIND:
            earlier = self._newest if scans[0].t == self.tracker.time else []
            taken = self.tracker.take_in(scans)
            self._newest = earlier + [scan.sensor for scan in scans]
            self.tracker.hand_over(taken)
            if self.tracker.has_diagnostics:
                self.measured.append((scans[0].t, self.tracker.last_measurements()[0]))
            return
        t, now = scans[0].t, self.tracker.snapshot()
        k = self._place(t)
        later = [copy(step) for step in self.steps[k:]]
        before = self.steps[k].before if later else now
        if later:
            self.tracker.restore(before)
        if k < len(self.steps) and self.steps[k].t == t:
            scans = self.steps[k].scans + scans
            del self.steps[k]
        # As files are read: the order of arrival must not show.
        self.steps.insert(k, TakenStep(t, sorted(scans, key=lambda scan: scan.sensor), before, None))
        try:
            for step in self.steps[k:]:
                if step is not self.steps[k]:
                    step.before = self.tracker.snapshot()
                step.taken = self.tracker.take_in(step.scans)
        except Exception:
            self.steps[k:] = later
            self.tracker.restore(now)
            raise
        self.replayed += len(self.steps) - k - 1
        newest = self.tracker.time
        assert newest is not None
        self._settle(newest - self._keep_s)

    def _settle(self, t: float) -> None:
        """Tell the smoothers of the steps before a time: nothing can come before them any more."""
        count = self._place(t)
        for step in self.steps[:count]:
            self.tracker.hand_over(step.taken)
            self._settled = step.t
        del self.steps[:count]


def _late_s(config: Config, sensor: str) -> float:
    own = config.sensors[sensor].late_s
    return config.live.late_s if own is None else own
