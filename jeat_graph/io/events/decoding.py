"""What the compiled loops that decode words of events share: their state, and the steps that they all make.

Every loop knows the time from words of their own or from the events, leaves out what has no time yet or lies
outside the picture, keeps the times in order, and counts what was wrong.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import IntArray
from jeat_graph.io.events.reader import Triggers

#: A time that steps ahead by more than this (µs) is remarked on: a camera's clock does not do so.
JUMP_US = 10_000_000
#: A single time that leaps ahead by more than this (µs), and that the next one takes back, is no time.
LEAP_US = 1_000_000
#: So many events one word may stand for.
MOST_OF_A_WORD = 32
#: A clock that stands whole in each event has so many bits (µs) and begins again after 71 min.
CLOCK_BITS = 32

# Places of the state that a loop keeps from block to block (int64).
FILLED, TRIGGERS, LAST, PREVIOUS, HIGH, WRAPS, LOW, ROW, BASE, POLARITY = range(10)
OUTSIDE, BACKWARDS, UNKNOWN, UNTIMED, JUMPS = range(10, 15)
HELD, HELD_FROM, LATE, LEAPS, ENDED, WAITS = range(15, 21)
STATE_SIZE = 21

#: What a leap of a counter may be: none, a lone one, or not known before more words are read.
NO_LEAP, LONE, OPEN = range(3)
#: So many words are waited for at most.
_MOST_AHEAD = 1 << 20


class Columns(NamedTuple):
    """Room for events: t_us (N,) int64, x, y (N,) uint16, polarity (N,) uint8."""

    t: IntArray
    x: npt.NDArray[np.uint16]
    y: npt.NDArray[np.uint16]
    p: npt.NDArray[np.uint8]


class Limits(NamedTuple):
    """First column and row outside the picture (px)."""

    width: int
    height: int


#: (words, state, events, triggers, limits) -> words that were used: all, unless the room is full or the state
#: `WAITS` for more words.
Decode = Callable[[Any, IntArray, Columns, Triggers, Limits], int]


def empty_state() -> IntArray:
    """Return the state before the first word: no time and no row is known."""
    state = np.zeros(STATE_SIZE, dtype=np.int64)
    state[HIGH] = state[ROW] = state[LAST] = state[PREVIOUS] = state[HELD_FROM] = -1
    return state


@numba.njit(cache=True, nogil=True)
def wraps(old: Any, new: Any, full: int) -> bool:
    """Tell a counter of `full` values that began again from one that stepped back by a fault."""
    quarter = full // 4
    return bool(old >= full - quarter and new < quarter)


@numba.njit(cache=True, nogil=True)
def leaps(new: Any, old: Any, low_bits: int) -> bool:
    """Whether a counter of the time above `low_bits` (µs) steps ahead by more than `LEAP_US`."""
    return bool(old >= 0 and new - old > LEAP_US >> low_bits)


@numba.njit(cache=True, nogil=True)
def kind_of_leap(counts: tuple[Any, Any, Any], full: int, left: int, state: IntArray) -> int:
    """Tell a lone leap, which the value after it takes back to where the counter was, and count it.

    As the counter does not begin again there, it would run backwards: no sound file has such a leap, and a
    gap in a recording is none.

    Args:
        counts: the value before the leap, the one that leaps, and the one after it; -1 if none has come yet.
        full: number of values of the counter.
        left: words that are there from the one that leaps on.
        state: of the loop.
    """
    old, new, after = counts
    if after < 0 and not state[ENDED] and left < _MOST_AHEAD:
        state[WAITS] = 1
        return OPEN
    if old <= after and after - old < new - after and not wraps(new, after, full):
        state[LEAPS] += 1
        return LONE
    return NO_LEAP


@numba.njit(cache=True, nogil=True)
def hold(count: Any, t: Any, last: Any, state: IntArray) -> None:
    """Count events that get the latest time in place of their own, which lies before it.

    Args:
        count: how many.
        t: their own time (µs).
        last: the latest time before them (µs).
        state: of the loop; it keeps the first such time and how late events became at most.
    """
    if state[HELD] == 0:
        state[HELD_FROM] = t
    state[HELD] += count
    state[LATE] = max(state[LATE], last - t)


@numba.njit(cache=True, nogil=True)
def turns_of_counter(new: Any, old: Any, turns: Any, bits: tuple[int, int], state: IntArray) -> int:
    """Return how often a counter of the time's upper bits began again; a jump ahead is remarked on.

    Args:
        new: its value.
        old: the one before; -1 if there was none.
        turns: how often it had begun again by then.
        bits: of the counter, and of the time (µs) below it.
        state: of the loop.
    """
    if wraps(old, new, 1 << bits[0]):
        return int(turns + 1)
    if old >= 0 and new - old > JUMP_US >> bits[1]:
        state[JUMPS] += 1
    return int(turns)


@numba.njit(cache=True, nogil=True)
def turns_of_clock(new: Any, old: Any, turns: Any, state: IntArray) -> int:
    """Return how often a clock of `CLOCK_BITS` began again; a jump and a step back are remarked on.

    To be asked where it does neither go on nor stand still, by at most `LEAP_US`: most events have no need.

    Args:
        new: its time (µs).
        old: that of the event before; -1 if there was none.
        turns: how often it had begun again by then.
        state: of the loop.
    """
    if new < old:
        if wraps(old, new, 1 << CLOCK_BITS):
            return int(turns + 1)
        state[BACKWARDS] += 1
    elif old >= 0 and new - old > JUMP_US:
        state[JUMPS] += 1
    return int(turns)


@numba.njit(cache=True, nogil=True)
def is_kept(x: Any, y: Any, timed: bool, limits: Limits, state: IntArray) -> bool:
    """Whether an event has a time and lies in the picture; if not, it is counted among those left out."""
    if not timed:
        state[UNTIMED] += 1
        return False
    if x >= limits.width or y >= limits.height:
        state[OUTSIDE] += 1
        return False
    return True


@numba.njit(cache=True, nogil=True)
def put_event(out: Columns, row: Any, t: Any, x: Any, y: Any, polarity: Any) -> int:
    """Write an event into a row, and return the next row."""
    out.t[row] = t
    out.x[row] = x
    out.y[row] = y
    out.p[row] = polarity
    return int(row + 1)


@numba.njit(cache=True, nogil=True)
def put_edge(triggers: Triggers, row: Any, t: Any, channel: Any, value: Any) -> int:
    """Write an edge of a signal into a row, and return the next row."""
    triggers.t_us[row] = t
    triggers.channel[row] = channel
    triggers.value[row] = value
    return int(row + 1)
