"""After a restart: scans that come again, from anywhere before the saved state, and those that are new.

The time of a scan says it as long as clocks go on: what is not newer than the state has been taken, if the
tracker could take it. What the content proves goes before that: a clock may have been set back while nobody
ran.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from jeat_graph.data.detections import Scan
from jeat_graph.live.memory import Memory, fingerprint_of
from jeat_graph.live.time_base import TimeBase

#: So many scans in a row that never came before say that the input is not given once more.
_NEVER = 3


class Repetition:
    """Tells scans that come again.

    Args:
        base: of the tracker.
        whole: whether the tracker has taken no scan yet.

    Attributes:
        until: after a restart, time of the newest scan that was known then (s); None once a new one has come.
        first: time of the first scan since time has started over (s).
    """

    def __init__(self, base: TimeBase, whole: bool) -> None:
        self._base = base
        self._memory = Memory(whole)
        self._never = 0  # scans in a row that never came before
        self._kept = 0  # messages that waited when the state was saved
        self.until: float | None = None
        self.first: float | None = None

    def sort(
        self, scans: Sequence[Scan], given: Sequence[Scan], was_taken: Callable[[Scan], bool]
    ) -> tuple[list[Scan], list[Scan], list[Scan]]:
        """Sort scans into those that come again, those that are too late, and those that are new.

        Args:
            scans: of one message.
            given: the same with their sensors' own times, where others were found meanwhile.
            was_taken: whether the tracker has taken a scan of that sensor and of a time up to `until`.

        Returns:
            What had been taken; what by its time was taken and by its content never came; all others.
        """
        again: list[Scan] = []
        late: list[Scan] = []
        new: list[Scan] = []
        for scan, as_given in zip(scans, given, strict=True):
            known = None if self.until is None else self._memory.knows(fingerprint_of(as_given))
            if not self._comes_again(scan, known, was_taken):
                new.append(scan)
            else:
                (late if known is False else again).append(scan)
        if again or late:  # what was passed over before the restart is so once more
            del self._base.row[self._kept :]
        return again, late, new

    def note(self, scans: Sequence[Scan]) -> None:
        """Take note of scans that have come, with their sensors' own times."""
        for scan in scans:
            self._memory.note(fingerprint_of(scan))

    def begins(self, first: float | None = None) -> None:
        """Note that time goes on elsewhere; from a first scan (s) again, if it is given."""
        self.until = None
        if first is not None:
            self.first = first

    def _comes_again(self, scan: Scan, known: bool | None, was_taken: Callable[[Scan], bool]) -> bool:
        if self.until is None:
            return False
        if known:
            self._never = 0
            return True
        self._never += known is False
        if self._never >= _NEVER:
            self.until = None  # the input is another
            return False
        if scan.t > self.until:
            if self._base.near(scan.t, self.until):
                self.until = None  # the first new one: no other of those before can follow
            return self._base.holds(scan)
        if self._between(scan.t):
            return self._base.holds(scan)
        return was_taken(scan)

    def _between(self, t: float) -> bool:
        """Whether a time (s) is known to be none of the tracker's steps."""
        if self.first is not None and not self._base.near(min(t, self.first), self.first):
            return True  # from before all that had come: a clock has been set back
        leap = self._base.leap
        return leap is not None and leap[0] < t < leap[1]

    def state(self) -> dict[str, Any]:
        """Return what `set_state` takes."""
        return {"first": self.first, "memory": self._memory.state()}

    def set_state(self, state: dict[str, Any], now: float | None) -> None:
        """Go on from what `state` returned.

        Args:
            state: it.
            now: the newest time then (s).
        """
        self.first, self.until = state["first"], now
        self._kept = len(self._base.row)
        self._memory.set_state(state["memory"])
