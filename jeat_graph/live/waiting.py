"""Scans that wait for those of a sensor which come later: by a clock that was found, or by a slow detector.

Where a sensor's scans come later than others of the same time by more than a tracker can go back, the others
wait for it, so that all are taken in order of time. They wait no longer than `most_s`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any, NamedTuple

from jeat_graph.data.detections import Scan


class Released(NamedTuple):
    """What became of scans that came to where others wait.

    Attributes:
        batches: scans to be taken now, in order of time, those of one time together.
        missed: scans from before the time that had been reached when others began to wait: too late for good.
    """

    batches: list[list[Scan]]
    missed: list[Scan]


class WaitingRoom:
    """Where scans wait.

    Args:
        slow: the sensors that are waited for, with the newest time of each (s).
        most_s: how long scans wait at most, by the times of all sensors (s).
        begun_s: the time that the tracker has reached (s).
        back_s: how far it can go back (s).
    """

    def __init__(self, slow: Mapping[str, float], most_s: float, begun_s: float, back_s: float) -> None:
        self._slow = dict(slow)
        self._most_s, self._back_s = most_s, back_s
        self._begun_s = self._newest_s = begun_s
        self._scans: list[Scan] = []

    @property
    def newest_s(self) -> float:
        """Time of the newest scan that has come (s)."""
        return self._newest_s

    def beside(self, other: WaitingRoom) -> WaitingRoom:
        """Return this room with those that wait in another, and for whom they do."""
        self._slow = {**other._slow, **self._slow}
        self._most_s = max(self._most_s, other._most_s)
        self._scans = other.clear()
        self._newest_s = max(self._newest_s, other._newest_s)
        return self

    def holds(self, scan: Scan) -> bool:
        """Whether the sensor's scan of that time waits."""
        return any(other.t == scan.t and other.sensor == scan.sensor for other in self._scans)

    def enter(self, scans: Sequence[Scan], bound_s: float) -> Released:
        """Let scans come in, and those that need not wait any longer go.

        Args:
            scans: of one message.
            bound_s: what is farther ahead, or behind all that wait, is none of this time and does not wait.
        """
        missed: list[Scan] = []
        far: list[Scan] = []
        for scan in scans:
            if not -bound_s - self._most_s <= scan.t - self._newest_s <= bound_s:
                far.append(scan)
                continue
            if scan.sensor in self._slow:
                self._slow[scan.sensor] = max(self._slow[scan.sensor], scan.t)
            if scan.sensor in self._slow and scan.t < self._begun_s - self._back_s:
                missed.append(scan)
            else:
                self._scans.append(scan)
                self._newest_s = max(self._newest_s, scan.t)
        until_s = max(min(self._slow.values()), self._newest_s - self._most_s)
        ready = [scan for scan in self._scans if scan.t <= until_s]
        self._scans = [scan for scan in self._scans if scan.t > until_s]
        return Released([*by_time(ready), *([far] if far else [])], missed)

    def jumped(self, t: float) -> None:
        """Note that time goes on elsewhere (s)."""
        self._begun_s, self._newest_s = -math.inf, t
        self._slow = dict.fromkeys(self._slow, t - self._most_s)

    def clear(self) -> list[Scan]:
        """Let all go that wait."""
        scans, self._scans = self._scans, []
        return scans

    def state(self) -> dict[str, Any]:
        """Return plain data, for `of_state`."""
        return {
            "slow": self._slow,
            "most_s": self._most_s,
            "begun_s": self._begun_s,
            "back_s": self._back_s,
            "newest_s": self._newest_s,
            "scans": self._scans,
        }

    @staticmethod
    def of_state(state: Mapping[str, Any]) -> WaitingRoom:
        """Return what `state` was taken of."""
        room = WaitingRoom(state["slow"], state["most_s"], state["begun_s"], state["back_s"])
        room._newest_s, room._scans = state["newest_s"], list(state["scans"])
        return room


def by_time(scans: Sequence[Scan]) -> list[list[Scan]]:
    """Return scans in order of time, those of one time together."""
    ordered = sorted(scans, key=lambda scan: scan.t)
    return [list(some) for _, some in groupby(ordered, key=lambda scan: scan.t)]
