"""How late the scans of each sensor came: counted in milliseconds, so that memory does not grow with time."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
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


@dataclass
class _Counted:
    """Counts of one sensor.

    Attributes:
        bins: (BINS,) scans by how late they were.
        late: scans that were late at all.
        dropped: scans that were passed over.
        worst_s: the latest (s).
    """

    bins: IntArray = field(default_factory=lambda: np.zeros(BINS, dtype=np.int64))
    late: int = 0
    dropped: int = 0
    worst_s: float = 0.0


class LatenessCounter:
    """Counts by sensor, of any names."""

    def __init__(self) -> None:
        self._by_sensor: dict[str, _Counted] = {}

    @property
    def dropped(self) -> int:
        """How many scans of all sensors were passed over."""
        return sum(one.dropped for one in self._by_sensor.values())

    def dropped_by_sensor(self) -> dict[str, int]:
        """How many scans of each sensor were passed over."""
        return {name: one.dropped for name, one in self._by_sensor.items()}

    def add(self, sensor: str, late_s: float, dropped: bool) -> None:
        """Count a scan that is so much older than the newest (s); 0 if it is not."""
        one = self._by_sensor.get(sensor)
        if one is None:
            one = self._by_sensor[sensor] = _Counted()
        late_s = min(late_s, sys.float_info.max)  # from one end of the numbers to the other it is infinite
        one.bins[round(min(late_s / BIN_S, BINS - 1))] += 1
        one.late += late_s > 0.0
        one.dropped += dropped
        one.worst_s = max(one.worst_s, late_s)

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
        """Return what `set_state` takes; of the bins only those that are not empty."""
        out = {}
        for name, one in self._by_sensor.items():
            filled = np.flatnonzero(one.bins)
            counts = {"filled": filled, "counts": one.bins[filled]}
            out[name] = counts | {"late": one.late, "dropped": one.dropped, "worst_s": one.worst_s}
        return out

    def set_state(self, state: dict[str, Any]) -> None:
        """Go on from what `state` returned."""
        for name, saved in state.items():
            one = _Counted(late=saved["late"], dropped=saved["dropped"], worst_s=saved["worst_s"])
            one.bins[saved["filled"]] = saved["counts"]
            self._by_sensor[name] = one

    def summary(self) -> dict[str, Lateness]:
        """Return the summary of each sensor that gave a scan, in alphabetical order."""
        out = {}
        for name, one in sorted(self._by_sensor.items()):
            below = np.cumsum(one.bins)
            scans = int(below[-1])
            median, p99 = (float(np.searchsorted(below, share * scans)) * BIN_S for share in (0.5, 0.99))
            out[name] = Lateness(scans, one.late, one.dropped, median, p99, one.worst_s)
        return out
