"""What became of scans that arrived."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from jeat_graph.data.detections import Scan
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.live.clock_watch import ClockNews
from jeat_graph.live.time_base import Decision
from jeat_graph.tracking.tracker import Tracker


class Arrival(NamedTuple):
    """What became of scans that arrived.

    Attributes:
        table: the tracks that are reported now.
        t: time of the newest step (s): that of the table.
        late_s: how much older the scans were than the newest before them (s), 0 for scans in order.
        dropped: those that were passed over: too late, or of a sensor that has given one of that time.
        repeated: those that had been taken before a checkpoint from which the tracker went on.
        held: those that wait, because their time is far from all others (`live.jump_s`).
        refuted: earlier ones that waited and are passed over now.
        reset: whether time has started over, because all scans were too late for long: all tracks have ended.
        leapt: whether time goes on much later, because scans ahead of time confirmed each other.
        taken: the scans that were taken, those that had waited too; times without the sensors' latency.
        waiting: those that wait for a sensor whose scans come later (`live.wait_s`).
        missed: those of such a sensor from before the time that had been reached when that was found.
        earlier: what was reported at times that had waited: time (s), table, how late (s), one after another.
        clocks: what is known of the sensors' clocks from now on.
    """

    table: Trajectories
    t: float
    late_s: float
    dropped: list[Scan]
    repeated: list[Scan]
    held: list[Scan]
    refuted: list[Scan]
    reset: bool
    leapt: bool = False
    taken: Sequence[Scan] = ()
    waiting: Sequence[Scan] = ()
    missed: Sequence[Scan] = ()
    earlier: Sequence[tuple[float, Trajectories, float]] = ()
    clocks: ClockNews | None = None


class Admitted(NamedTuple):
    """What became of scans that were let in to the tracker together.

    Attributes:
        scans: they.
        decision: what was decided.
        taken: by time.
        t: time of the newest step after that (s).
        table: the tracks that are reported then.
    """

    scans: list[Scan]
    decision: Decision
    taken: list[Taken]
    t: float
    table: Trajectories

    @property
    def late_s(self) -> float:
        """How much older the scans were than the newest before them (s)."""
        return max((one.late_s for one in self.taken), default=0.0)


class Taken(NamedTuple):
    """What became of scans of one time: those that were taken, those passed over, and how late they were."""

    good: list[Scan]
    dropped: list[Scan]
    late_s: float


def scanned_last(tracker: Tracker) -> list[str]:
    """Names of the sensors that gave the scans of a tracker's last step."""
    return [name for name, t in tracker.last_scans().items() if t == tracker.time]
