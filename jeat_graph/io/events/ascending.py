"""Events that come as arrays, kept in the order of their times, and what had to be mended of them counted."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.core import events as decoders
from jeat_graph.data.arrays import IntArray
from jeat_graph.io.events.reader import Damage

#: So many events may lie between one and an earlier one that follows it: they are held to be sorted.
SORT_ROWS = 1 << 20
# What a jump and a leap are is the same for times that come as words and for those that come as arrays (µs).
JUMP_US, LEAP_US = decoders.JUMP_US, decoders.LEAP_US


class Ascending:
    """Gives events after a step back in time the latest time before them, piece by piece.

    Args:
        damage: where steps back, and events that they changed, are counted.
    """

    def __init__(self, damage: Damage) -> None:
        self._damage = damage
        self._latest: int | None = None
        self._previous = 0

    def __call__(self, t_us: IntArray) -> IntArray:
        """Return the times (N,) of the next events (µs), none before the latest so far."""
        if not len(t_us):
            return t_us
        first = self._latest is None
        previous = int(t_us[0]) if first else self._previous
        latest = previous if self._latest is None else self._latest
        damage = self._damage
        damage.backwards += int((np.diff(t_us, prepend=previous) < 0).sum())
        kept: IntArray = np.maximum.accumulate(np.maximum(t_us, latest))
        held = np.flatnonzero(kept > t_us)
        if len(held):
            damage.held_from_us = damage.held_from_us if damage.held else int(t_us[held[0]])
            damage.held += len(held)
            damage.late_us = max(damage.late_us, int((kept - t_us).max()))
        self._previous, self._latest = int(t_us[-1]), int(kept[-1])
        return kept


class Unordered(NamedTuple):
    """Events in no order yet: t (N,) µs, x, y (N,) px, p (N,) 0 or 1; all of them in the picture."""

    t: IntArray
    x: npt.NDArray[np.uint16]
    y: npt.NDArray[np.uint16]
    p: npt.NDArray[np.uint8]

    def take(self, rows: slice | npt.NDArray[Any]) -> Unordered:
        """Return the given rows."""
        return Unordered(self.t[rows], self.x[rows], self.y[rows], self.p[rows])


class Sorter:
    """Puts events in order, as far as they lie within `SORT_ROWS` of where they belong.

    Args:
        damage: where what was mended is counted.
    """

    def __init__(self, damage: Damage) -> None:
        self._damage = damage
        self._held: list[Unordered] = []
        self._count = 0
        self._latest = -1
        self.given_us = -1

    def too_late(self, t: IntArray) -> int | None:
        """Return the place of the first time (N,) before what was given out, but for lone ones; else None."""
        early = t < self.given_us
        if not early.any():
            return None
        early &= _mended(t, self._latest)[0] < self.given_us
        return int(np.argmax(early)) if early.any() else None

    def push(self, events: Unordered) -> Iterator[Unordered]:
        """Take events; yield those that nothing can come before any more."""
        if not len(events.t):
            return
        events = self._without_lone(events)
        latest = np.maximum.accumulate(np.maximum(events.t, self._latest))
        self._damage.sorted += int((events.t < latest).sum())
        self._latest = int(latest[-1])
        self._held.append(events)
        self._count += len(events.t)
        if self._count > 2 * SORT_ROWS:
            yield self._give(self._count - SORT_ROWS)

    def rest(self) -> Iterator[Unordered]:
        """Yield what is left."""
        if self._count:
            yield self._give(self._count)

    def _give(self, count: int) -> Unordered:
        joined = Unordered(*(np.concatenate(columns) for columns in zip(*self._held, strict=True)))
        if (np.diff(joined.t) < 0).any():
            joined = joined.take(np.argsort(joined.t, kind="stable"))
        self._held = [joined.take(slice(count, None))]
        self._count -= count
        given = joined.take(slice(0, count))
        before = self.given_us if self.given_us >= 0 else int(given.t[0])
        self._damage.jumps += int((np.diff(given.t, prepend=before) > JUMP_US).sum())
        self.given_us = int(given.t[-1])
        return given

    def _without_lone(self, events: Unordered) -> Unordered:
        """Give single times that leap away, and that the next one takes back, the time before them."""
        t, ahead, back = _mended(events.t, self._latest)
        if t is events.t:
            return events
        self._damage.leaps += int(ahead.sum())
        if back.any():
            damage, late = self._damage, t[back] - events.t[back]
            damage.held_from_us = damage.held_from_us if damage.held else int(events.t[back][0])
            damage.held += int(back.sum())
            damage.backwards += int(back.sum())
            damage.late_us = max(damage.late_us, int(late.max()))
        return events._replace(t=t)


def _mended(t: IntArray, latest: int) -> tuple[IntArray, npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Return times (N,) in which a single one that leaps by more than `LEAP_US` has the time before it.

    Args:
        t: times in the order of the file (µs).
        latest: the latest time before them; -1 if there was none.

    Returns:
        The times, where they leapt ahead, and where back. If that does not put them in order, they are not
        single ones, and nothing is changed.
    """
    before = np.concatenate(([latest if latest >= 0 else t[0]], t[:-1]))
    after = np.concatenate((t[1:], t[-1:]))
    ahead = (t - before > LEAP_US) & (after < t) & (after >= before)
    back = (before - t > LEAP_US) & (after >= before)
    lone = ahead | back
    mended = np.where(lone, before, t)
    if not lone.any() or (np.diff(mended) < 0).any():
        none = np.zeros(len(t), dtype=bool)
        return t, none, none
    return mended, ahead, back
