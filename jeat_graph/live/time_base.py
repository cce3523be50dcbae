"""Scans whose time is far from all others: held until more of them say that it is now so late.

One scan with a time in the future would end all tracks and make all that comes after it too late, and a clock
that was set back would make everything too late for good. So what is farther from the newest time than any
pause between scans so far explains is held. A scan that fits the time as it was proves those wrong that are
held. Ahead of time they are believed when two sensors agree, when a sensor that is alone gives three in a
row, or when they go on for long enough; behind it, when they go on for long enough. Nothing of that asks for
the clock on the wall: the same scans in the same order are always taken alike.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any

from jeat_graph.data.detections import Scan

#: Pauses between scans that are remembered, and how many times the longest of them is still a usual one.
_PAUSES, _USUAL = 8, 4.0
#: So many in a row are believed of a sensor beside which there is no other.
_ALONE = 3


class TimeBase:
    """Tells scans that fit the time so far from those that do not.

    Args:
        jump_s: a scan so far from the newest time is held, if the latest pauses were not as long (s).

    Attributes:
        held: scans that wait, in order of arrival.
    """

    def __init__(self, jump_s: float) -> None:
        self._jump_s = jump_s
        self._pauses: deque[float] = deque(maxlen=_PAUSES)
        self.held: list[Scan] = []

    @property
    def bound_s(self) -> float:
        """How far from the newest time a scan may be (s)."""
        return max(self._jump_s, _USUAL * max(self._pauses, default=0.0))

    def fits(self, t: float, now: float | None) -> bool:
        """Whether a time is near the newest one (s)."""
        return now is None or abs(t - now) <= self.bound_s

    def holds(self, scan: Scan) -> bool:
        """Whether the sensor's scan of that time waits already."""
        return any(other.t == scan.t and other.sensor == scan.sensor for other in self.held)

    def hold(self, scans: Sequence[Scan], now: float, last_look: dict[str, float]) -> tuple[list[Scan], bool]:
        """Let scans that do not fit wait.

        Args:
            scans: they.
            now: the newest time so far (s).
            last_look: time of each sensor's last scan that was taken (s).

        Returns:
            Those that they prove wrong, which waited before; and whether those that wait now are believed.
        """
        t, sensors = scans[0].t, {scan.sensor for scan in (*self.held, *scans)}
        alone = t > now and all(
            look < now - self.bound_s for name, look in last_look.items() if name not in sensors
        )
        # A sensor beside which there is no other may be a slow one, whose pauses are not known yet.
        apart_s = max(self.bound_s, abs(self.held[0].t - now)) if self.held and alone else self.bound_s
        refuted = self.clear() if self.held and abs(t - self.held[-1].t) > apart_s else []
        self.held += [scan for scan in scans if not self.holds(scan)]
        times, sensors = [scan.t for scan in self.held], {scan.sensor for scan in self.held}
        in_a_row = len(self.held) >= _ALONE
        if in_a_row and (alone or max(times) - min(times) >= self.bound_s):
            return refuted, True
        return refuted, t > now and len(sensors) > 1

    def clear(self) -> list[Scan]:
        """Return the scans that wait, and hold none any more."""
        held, self.held = self.held, []
        return held

    def passed(self, before: float | None, now: float | None) -> None:
        """Note that the newest time has gone on (s)."""
        if before is not None and now is not None and now > before:
            self._pauses.append(now - before)

    def state(self) -> dict[str, Any]:
        """Return plain data, for `set_state`."""
        return {"held": self.held, "pauses": list(self._pauses)}

    def set_state(self, state: dict[str, Any]) -> None:
        """Go on from what `state` returned."""
        self.held = state["held"]
        self._pauses.extend(state["pauses"])
