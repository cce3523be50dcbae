"""Warnings to the user of a live session: of scans that are not taken, and of times that jump.

What may come often is reported the first times, and is then counted; what goes on for long is reported again
and again (see `untaken`).
"""

from __future__ import annotations

import math
from collections.abc import Callable

from jeat_graph.data.errors import DataError
from jeat_graph.live.arrival import Arrival
from jeat_graph.live.messages import ScanMessage
from jeat_graph.live.untaken import Untaken, UntakenRun

#: So many scans passed over are reported one by one; the rest is in the summary.
MOST_WARNED = 5


class SessionWarnings:
    """Tells it.

    Args:
        warn: takes one line.
        jump_s: of the settings: so long (s) nothing of a sensor is taken before that is reported.
    """

    def __init__(self, warn: Callable[[str], object], jump_s: float) -> None:
        self._warn = warn
        self._scans = self._restarts = 0
        self._untaken = Untaken(jump_s)  # by sensor
        # By source: what is given again after a restart may be long, and is reported less and less often.
        self._again = Untaken(2.0 * jump_s, most_s=math.inf)

    def restart(self, message: ScanMessage, place: str) -> None:
        """A source counts its messages from the start again."""
        self._restarts += 1
        self._first(
            self._restarts,
            f"{place}source {message.source!r} restarts its count at seq {message.seq}, with another time: "
            "it was started again, and its messages are taken",
        )

    def again(self, message: ScanMessage, place: str) -> None:
        """A message had been taken before."""
        run = self._again.untaken(message.source, message.batch.t)
        if run is not None:
            self._warn(
                f"warning: {place}the last {run.count} messages had been taken before and are passed over, "
                f"up to t = {message.batch.t:.3f} s"
            )

    def arrived(self, arrival: Arrival, source: str, before: float | None, place: str) -> None:
        """Scans have arrived.

        Args:
            arrival: what became of them.
            source: where they come from.
            before: the newest time before (s).
            place: the message's, for the user.
        """
        self._again.taken([source])
        self._dropped(arrival, place)
        self._times(arrival, before)
        self._runs(arrival, place)

    def _dropped(self, arrival: Arrival, place: str) -> None:
        """Tell of the first scans passed over."""
        if not arrival.dropped:
            return
        self._scans += 1
        late = f"{arrival.late_s:.6g} s late"
        why = late if arrival.late_s > 0.0 else "the sensor's scan of that time has come before"
        self._first(self._scans, f"{place}passed over, {why}")

    def _times(self, arrival: Arrival, before: float | None) -> None:
        """Tell of scans whose time was proved wrong, and of a time that goes on elsewhere."""
        if arrival.reset:
            self._warn(
                "warning: scans have been too late for long, so a clock was set back: all tracks end, and "
                f"time goes on from t = {arrival.t:.3f} s"
            )
        if arrival.leapt and before is not None:
            self._warn(
                f"warning: after a pause, or a leap of a clock, of {arrival.t - before:.3f} s time goes on "
                f"from t = {arrival.t:.3f} s"
            )
        for scan in arrival.refuted:
            self._scans += 1
            if self._scans <= MOST_WARNED:
                self._warn(
                    f"warning: passed over, sensor {scan.sensor!r} gave the time {scan.t:.3f} s, which no "
                    "other scan confirms"
                )

    def _runs(self, arrival: Arrival, place: str) -> None:
        """Tell, again and again, of sensors of which nothing is taken, and of the end of that."""
        for name, run in self._untaken.taken(scan.sensor for scan in arrival.taken):
            self._warn(f"warning: {place}scans of sensor {name!r} are taken again, after {run.count}")
        if not (arrival.held or arrival.dropped):
            return
        taken = {scan.sensor for scan in arrival.taken}
        missed = {s.sensor: s.t for s in (*arrival.held, *arrival.dropped) if s.sensor not in taken}
        for name, t in sorted(missed.items()):
            due = self._untaken.untaken(name, t)
            if due is not None:
                self._warn(
                    f"warning: {place}none of the last {due.count} scans of sensor {name!r} has been taken: "
                    f"the time {t:.3f} s {_where(t, arrival.t)}"
                )

    def _first(self, number: int, text: str) -> None:
        """Tell of something that may come often, the first times."""
        if number <= MOST_WARNED:
            more = "; further ones are only counted" if number == MOST_WARNED else ""
            self._warn(f"warning: {text}{more}")


def _where(t: float, now: float) -> str:
    if t == now:
        return "comes again and again"
    return f"is {abs(t - now):.3f} s {'after' if t > now else 'before'} the newest, {now:.3f} s"


class BadLines:
    """Tells of lines, or messages, that cannot be read: of the first, and again and again of many in a row.

    Args:
        warn: takes one line.
    """

    def __init__(self, warn: Callable[[str], object]) -> None:
        self._warn = warn
        self._run = UntakenRun(math.inf)
        self._bad = self._good = 0

    def add(self, error: DataError, good: int) -> None:
        """Tell of one.

        Args:
            error: what is wrong with it.
            good: how many have been taken so far.
        """
        if good > self._good:
            self._good = good
            self._run.taken()
        again = self._run.untaken(0.0)
        self._bad += 1
        if self._bad <= MOST_WARNED:
            self._warn(f"warning: {error}; passed over")
        elif again:
            self._warn(f"warning: the last {self._run.count} were all passed over; {error}")
