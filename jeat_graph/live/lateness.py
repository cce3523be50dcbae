"""How late the scans of each sensor came: counted in milliseconds, so that memory does not grow with time."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.data.arrays import IntArray
from jeat_graph.data.detections import Scan
from jeat_graph.live.arrival import Taken

#: Width of a bin (s), and how many there are; what is later counts in the last one.
BIN_S, BINS = 0.001, 10_000
#: So late is what counts in the last bin, or later (s).
COUNTED_S = (BINS - 1) * BIN_S


class Lateness(NamedTuple):
    """Summary of one sensor.

    Attributes:
        scans: how many came.
        late: how many of them were older than one that had come before, of any sensor.
        dropped: how many of these came too late, or twice, and were passed over.
        median_s: median of how much older each was than the newest before (s), 0 for one that was newer.
        p99_s: its 99th percentile (s); `COUNTED_S` stands for more, here and for the median.
        max_s: the most (s).
    """

    scans: int
    late: int
    dropped: int
    median_s: float
    p99_s: float
    max_s: float

    def text(self) -> str:
        """How late the scans were, in a few words."""
        often = f"{self.late} of {self.scans} scans late"
        if self.median_s >= COUNTED_S:
            return f"{often}, most by more than {COUNTED_S:g} s"
        within = f"99 % within {1e3 * self.p99_s:.0f} ms"
        if self.p99_s >= COUNTED_S:
            within = f"more than 1 % by more than {COUNTED_S:g} s"
        return f"{often}, median {1e3 * self.median_s:.0f} ms, {within}"


class LatenessCounter:
    """Counts by sensor.

    Args:
        sensor_names: names of the S sensors.

    Attributes:
        counts: (S, BINS) scans by how late they were.
        late: (S,) scans that were late at all.
        dropped: (S,) scans that were passed over.
        worst_s: (S,) the latest (s).
    """

    def __init__(self, sensor_names: tuple[str, ...]) -> None:
        self._names = sensor_names
        self.counts: IntArray = np.zeros((len(sensor_names), BINS), dtype=np.int64)
        self.late: IntArray = np.zeros(len(sensor_names), dtype=np.int64)
        self.dropped: IntArray = np.zeros(len(sensor_names), dtype=np.int64)
        self.worst_s = np.zeros(len(sensor_names))

    def among(self, sensor_names: tuple[str, ...]) -> LatenessCounter:
        """Return the same counts of a tracker that has more sensors, among them these."""
        out = LatenessCounter(sensor_names)
        rows = [sensor_names.index(name) for name in self._names]
        for name in ("counts", "late", "dropped", "worst_s"):
            getattr(out, name)[rows] = getattr(self, name)
        return out

    def add(self, sensor: str, late_s: float, dropped: bool) -> None:
        """Count a scan that is so much older than the newest (s); 0 if it is not."""
        s = self._names.index(sensor)
        late_s = min(late_s, sys.float_info.max)  # from one end of the numbers to the other it is infinite
        self.counts[s, round(min(late_s / BIN_S, BINS - 1))] += 1
        self.late[s] += late_s > 0.0
        self.dropped[s] += dropped
        self.worst_s[s] = max(self.worst_s[s], late_s)

    def arrived(self, taken: Sequence[Taken], refuted: Sequence[Scan], before: float | None) -> None:
        """Count scans that have arrived.

        Args:
            taken: what became of those of each time.
            refuted: those that had waited and are passed over.
            before: the newest time before (s).
        """
        for scan in refuted:
            self.add(scan.sensor, max((before or 0.0) - scan.t, 0.0), True)
        for one in taken:
            for scans, passed_over in ((one.good, False), (one.dropped, True)):
                for scan in scans:
                    self.add(scan.sensor, one.late_s, passed_over)

    def state(self) -> dict[str, Any]:
        """Return what `set_state` takes; of the counts only those that are not zero."""
        where = np.nonzero(self.counts)
        return {
            "where": np.array(where),
            "counts": self.counts[where],
            "late": self.late,
            "dropped": self.dropped,
            "worst_s": self.worst_s,
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Go on from what `state` returned."""
        self.counts[tuple(state["where"])] = state["counts"]
        self.late, self.dropped, self.worst_s = state["late"], state["dropped"], state["worst_s"]

    def summary(self) -> dict[str, Lateness]:
        """Return the summary of each sensor that gave a scan."""
        out = {}
        for s, name in enumerate(self._names):
            below = np.cumsum(self.counts[s])
            if not below[-1]:
                continue
            median, p99 = (float(np.searchsorted(below, share * below[-1])) * BIN_S for share in (0.5, 0.99))
            out[name] = Lateness(
                int(below[-1]), int(self.late[s]), int(self.dropped[s]), median, p99, float(self.worst_s[s])
            )
        return out
