"""Which time it is now: what becomes of scans whose times do not follow those before them.

One scan with a time in the future would end all tracks and make all that comes after it too late, and a clock
that was set back would make everything too late for good. So there are two times: the *present* one, which
the tracker has reached, and one that *waits* to replace it. Each message does one of four things:

==============  =======================================  ===============================================
the message     when                                     what is done
==============  =======================================  ===============================================
follows         near the present time (`bound_s`), and   taken; those that wait are refuted
                some scan of it can be taken
comes too late  near the present time, but all of it is  passed over; it waits as a witness, without scans
                too late, or has come before
is far away     farther than `bound_s`                   held; it waits as a witness
comes again     it waits already                         the same; it is no further witness
==============  =======================================  ===============================================

Witnesses that wait form a row: one that is not near the last of them refutes the row and begins another. The
row is believed, and its time becomes the present one, when it has at least three messages and

- it has gone on for `jump_s` of its own time, or for a thousand messages (a clock that hardly moves); or
- it is ahead, and of several sensors, or of one beside which no other has been heard of late; or
- it is far behind, and longer than the messages that the present time has had since it replaced another, if
  these are ten at most: some wrong messages in a row may be believed, and then the stream behind them is.

A message is one witness, however many scans it has. The bound follows the usual pauses between scans. A jump
to another time is none of them, so it never widens the bound; and however wide that is, nothing is passed
over for longer than `jump_s` by a time that nobody confirms. Nothing of this asks for the clock on the wall:
the same scans in the same order are always taken in the same way.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

from jeat_graph.data.detections import Scan

#: Pauses between scans that are remembered. The second longest counts, for one alone is not usual; so many
#: times that is still near.
_PAUSES, _USUAL = 8, 4.0
#: Nothing is near that is farther away than this, whatever the pauses are (s), unless `jump_s` is longer.
_FARTHEST_S = 60.0
#: A row of fewer messages is never believed, and one of so many always is.
_LEAST, _MOST = 3, 1000
#: A present time of no more messages since it replaced another is outvoted by a longer row.
_YOUNG = 10


class Witness(NamedTuple):
    """A message that waits.

    Attributes:
        t: its newest time (s).
        sensors: names of its sensors.
        scans: what is taken when it is believed; none of a message that was passed over as too late.
    """

    t: float
    sensors: list[str]
    scans: list[Scan]


class Decision(NamedTuple):
    """What becomes of a message.

    Attributes:
        take: scans to be taken now, those that waited first.
        refuted: scans that waited and are passed over.
        leapt: whether a row ahead was believed: time goes on there.
        reset: whether a row behind was believed: time starts over there.
    """

    take: list[Scan]
    refuted: list[Scan]
    leapt: bool = False
    reset: bool = False


class TimeBase:
    """Tells scans that follow those before them from those that do not.

    Args:
        jump_s: what is farther from the newest time is held, unless the usual pauses are as long (s).

    Attributes:
        row: the messages that wait, in order of arrival.
        leap: the newest time before and the oldest after the last leap ahead (s); nothing between was taken.
    """

    def __init__(self, jump_s: float) -> None:
        self._jump_s = jump_s
        self._pauses: deque[float] = deque(maxlen=_PAUSES)
        self._messages = 0  # taken since the present time last replaced another
        self.row: list[Witness] = []
        self.leap: tuple[float, float] | None = None

    @property
    def bound_s(self) -> float:
        """How far from the newest time a scan may be to be near it (s)."""
        usual = sorted(self._pauses)[-2] if len(self._pauses) > 1 else 0.0
        return max(self._jump_s, min(_USUAL * usual, _FARTHEST_S))

    def near(self, t: float, now: float | None) -> bool:
        """Whether a time is near the newest one (s)."""
        # The bound is never less than `jump_s`, and finding it takes longer.
        return now is None or abs(t - now) <= self._jump_s or abs(t - now) <= self.bound_s

    def holds(self, scan: Scan) -> bool:
        """Whether the sensor's scan of that time waits already."""
        return any(other.t == scan.t and other.sensor == scan.sensor for w in self.row for other in w.scans)

    def decide(
        self, scans: Sequence[Scan], now: float | None, late: bool, last_scan: dict[str, float]
    ) -> Decision:
        """Decide what becomes of a message.

        Args:
            scans: those of the message that have not come before.
            now: the newest time so far (s), None before the first scan.
            late: whether none of them can be taken: they are too late, or have come before.
            last_scan: time of each sensor's last scan that was taken (s).
        """
        t = max(scan.t for scan in scans)
        far = not self.near(t, now)
        if now is None or not (far or late):
            return Decision(list(scans), self.clear())
        sensors = sorted({scan.sensor for scan in scans})
        if any(t == w.t and sensors == w.sensors for w in self.row[-1:]) or all(map(self.holds, scans)):
            return Decision([] if far else list(scans), [])
        known = {name for w in self.row for name in w.sensors} | set(sensors)
        alone = t > now and all(
            seen < now - self.bound_s for name, seen in last_scan.items() if name not in known
        )
        refuted = self.clear() if self.row and abs(t - self.row[-1].t) > self._apart_s(now, alone) else []
        self.row.append(Witness(t, sensors, list(scans) if far else []))
        if not self._believed(now, far, alone):
            return Decision([] if far else list(scans), refuted)
        return self._replace(scans, now, refuted)

    def took(self, before: float | None, now: float | None) -> None:
        """Note that a message was taken that followed, and that the newest time has gone on (s)."""
        self._messages += 1
        if before is not None and now is not None and now > before:
            self._pauses.append(now - before)

    def clear(self) -> list[Scan]:
        """Return the scans that wait, and hold none any more."""
        row, self.row = self.row, []
        return [scan for witness in row for scan in witness.scans]

    def _apart_s(self, now: float, alone: bool) -> float:
        """How far from the last witness the next may be (s)."""
        # A sensor beside which there is no other may be a slow one, with pauses that are not known yet.
        return max(self.bound_s, abs(self.row[0].t - now)) if alone else self.bound_s

    def _believed(self, now: float, far: bool, alone: bool) -> bool:
        """Whether the row replaces the present time."""
        count = len(self.row)
        if count < _LEAST:
            return False
        lasted_s = sum(abs(second.t - first.t) for first, second in pairwise(self.row))
        if lasted_s >= self._jump_s or count >= _MOST:
            return True
        if self.row[-1].t > now:
            return alone or len({name for w in self.row for name in w.sensors}) > 1
        return far and self._messages <= _YOUNG and count > self._messages

    def _replace(self, scans: Sequence[Scan], now: float, refuted: list[Scan]) -> Decision:
        """Let the row be the present time."""
        row, ahead = self.row, self.row[-1].t > now
        # Of a row behind, what was passed over is gone; its last message may still be taken.
        take = self.clear() if row[-1].scans else [*self.clear(), *scans]
        self._messages = len(row)
        # Steps within the row are pauses that its messages confirm; the jump to it is none.
        self._pauses.extend(min(b.t - a.t, _FARTHEST_S) for a, b in pairwise(row) if b.t > a.t)
        self.leap = (now, min(scan.t for scan in take)) if ahead else None
        return Decision(take, refuted, leapt=ahead, reset=not ahead)

    def state(self) -> dict[str, Any]:
        """Return plain data, for `set_state`."""
        return {
            "row": [tuple(witness) for witness in self.row],
            "pauses": list(self._pauses),
            "messages": self._messages,
            "leap": self.leap,
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Go on from what `state` returned."""
        self.row = [Witness(t, list(sensors), list(scans)) for t, sensors, scans in state["row"]]
        self._pauses.extend(state["pauses"])
        self._messages = state["messages"]
        self.leap = None if state["leap"] is None else tuple(state["leap"])
