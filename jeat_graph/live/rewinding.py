"""Steps that may be taken again: the tracker's state before each of the latest, and its scans."""

from __future__ import annotations

import math
from bisect import bisect_left
from copy import copy
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.data.arrays import IntArray
from jeat_graph.data.detections import Scan
from jeat_graph.live.identities import Identities
from jeat_graph.tracking.model_saving import ModelSnapshot
from jeat_graph.tracking.pending_step import PendingStep
from jeat_graph.tracking.tracker import Tracker


@dataclass
class ReplayableStep:
    """A step that may still be taken again, of M detections.

    Attributes:
        t: its time (s).
        scans: its scans, sensors in alphabetical order.
        before: the tracker's state before it.
        living: identities (N,) of the tracks that lived before it, and that of the next one to be born.
        taken: what the smoothers are to get of it.
        known: (M,) identity whose track took each detection, 0 where none ever did.
    """

    t: float
    scans: list[Scan]
    before: ModelSnapshot
    living: tuple[IntArray, int]
    taken: PendingStep | None
    known: IntArray


class Mark(NamedTuple):
    """What `Rewinding.go_back` takes."""

    now: ModelSnapshot
    steps: list[ReplayableStep]
    replayed: int
    identities: dict[str, Any]


class Rewinding:
    """Puts scans where they belong in the order of time, by taking the steps behind them again.

    Args:
        tracker: the tracker, new or loaded; it must log which track each detection went to (`logs_assigned`)
            when scans are inserted.

    Attributes:
        steps: the steps that may still be taken again, by time.
        replayed: how many steps have been taken again so far.
        settled: time of the last step that the smoothers have got (s).
        identities: what is given out for the tracks.
    """

    def __init__(self, tracker: Tracker) -> None:
        self._tracker = tracker
        self.steps: list[ReplayableStep] = []
        self.replayed = 0
        self.settled = -math.inf
        self.identities = Identities(*tracker.living())

    def place(self, t: float) -> int:
        """Return the place among the steps of the first that is not before a time (s)."""
        if not self.steps or t > self.steps[-1].t:  # nearly always: of a scan that is not late
            return len(self.steps)
        return bisect_left(self.steps, t, key=lambda step: step.t)

    def knows(self, scan: Scan) -> bool:
        """Whether the sensor has given a scan of that time which may still be taken again."""
        k = self.place(scan.t)
        known = self.steps[k].scans if k < len(self.steps) and self.steps[k].t == scan.t else []
        return any(other.sensor == scan.sensor for other in known)

    def insert(self, scans: list[Scan]) -> None:
        """Put scans of one time where they belong, and take all steps from there on again.

        Raises:
            DataError: as `Tracker.take_in`; the state is as before.
        """
        tracker = self._tracker
        t, now = scans[0].t, tracker.snapshot()
        k = self.place(t)
        later = [copy(step) for step in self.steps[k:]]
        before = later[0].before if later else now
        if later:
            tracker.restore(before)
        step = ReplayableStep(t, _by_sensor(scans), before, tracker.living(), None, _nobody(scans))
        if later and later[0].t == t:
            step = _joined(self.steps.pop(k), step)
        self.steps.insert(k, step)
        assigned = []
        try:
            for step in self.steps[k:]:
                if step is not self.steps[k]:
                    step.before, step.living = tracker.snapshot(), tracker.living()
                step.taken = tracker.take_in(step.scans)
                assigned.append(tracker.assigned(len(step.known)))
        except Exception:
            self.steps[k:] = later
            tracker.restore(now)
            raise
        again = self.steps[k:]
        known = [step.known for step in again]
        births = again[0].living[1], tracker.num_born + 1
        known = self.identities.follow(*births, assigned, known, self.steps[0].living[1])
        for step, identities in zip(again, known, strict=True):
            step.known = identities
        self.replayed += len(again) - 1

    def settle(self, t: float) -> None:
        """Tell the smoothers of the steps before a time (s): nothing can come before them any more."""
        count = self.place(t)
        for step in self.steps[:count]:
            if step.taken is not None:
                self._tracker.hand_over(step.taken._replace(given=self.identities.of(step.taken.ids)))
            self.settled = step.t
        del self.steps[:count]
        if count:
            self.identities.forget(*(self.steps[0].living if self.steps else self._tracker.living()))

    def mark(self) -> Mark:
        """Return what `go_back` needs."""
        steps = [copy(step) for step in self.steps]
        return Mark(self._tracker.snapshot(), steps, self.replayed, self.identities.state())

    def go_back(self, mark: Mark) -> None:
        """Undo what has been inserted since, if nothing has been settled."""
        self._tracker.restore(mark.now)
        self.steps, self.replayed = mark.steps, mark.replayed
        self.identities = Identities.from_state(mark.identities)

    def state(self) -> dict[str, Any]:
        """Return plain data for `set_state`; the tracker's is that before the first of the steps."""
        return {
            "steps": [step.scans for step in self.steps],
            "known": [step.known for step in self.steps],
            "settled": self.settled,
            "replayed": self.replayed,
            "identities": self.identities.state(),
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Go on from what `state` returned: the steps are taken again."""
        self.settled, self.replayed = state["settled"], state["replayed"]
        for scans, known in zip(state["steps"], state["known"], strict=True):
            before, living = self._tracker.snapshot(), self._tracker.living()
            taken = self._tracker.take_in(scans)
            self.steps.append(ReplayableStep(scans[0].t, scans, before, living, taken, known))
        self.identities = Identities.from_state(state["identities"])


def _by_sensor(scans: list[Scan]) -> list[Scan]:
    """As files are read: the order of arrival must not show."""
    return sorted(scans, key=lambda scan: scan.sensor)


def _nobody(scans: list[Scan]) -> IntArray:
    return np.zeros(sum(len(scan) for scan in scans), dtype=np.int64)


def _joined(old: ReplayableStep, more: ReplayableStep) -> ReplayableStep:
    """A step of the scans of two, of other sensors at one time; what is known of detections stays."""
    scans = _by_sensor(old.scans + more.scans)
    known = _nobody(scans)
    known[np.repeat([scan in old.scans for scan in scans], [len(scan) for scan in scans])] = old.known
    return ReplayableStep(old.t, scans, more.before, more.living, None, known)
