"""EVT 3.0, Prophesee's raw format of 16-bit words: row, time and polarity are said only when they change.

==========================  ======  ==========================================================================
word, bits 15..12           value   bits below
==========================  ======  ==========================================================================
row                         0       10..0 row of the events that follow
event                       2       11 polarity, 10..0 column
first column of a group     3       11 polarity, 10..0 column
group of 12, of 8           4, 5    one bit for each column from the first, which moves on by 12 or 8
time, low and high          6, 8    11..0 bits 11..0, and 23..12, of the time (µs): 16.8 s in all
edge of a signal            10      11..8 channel, 0 value
others, continued           14, 7,  what the camera says about itself; passed over
                            15
==========================  ======  ==========================================================================

Source: https://docs.prophesee.ai/stable/data/encoding_formats/evt3.html
"""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

import numba
import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import IntArray
from jeat_graph.io.events.decoding import (
    BACKWARDS,
    BASE,
    FILLED,
    HIGH,
    LAST,
    LONE,
    LOW,
    MOST_OF_A_WORD,
    NO_LEAP,
    OPEN,
    POLARITY,
    PREVIOUS,
    ROW,
    TRIGGERS,
    UNKNOWN,
    UNTIMED,
    WRAPS,
    Columns,
    Limits,
    hold,
    is_kept,
    kind_of_leap,
    leaps,
    put_edge,
    put_event,
    turns_of_counter,
)
from jeat_graph.io.events.reader import Triggers
from jeat_graph.io.events.words import WordReader

HIGH_BITS, LOW_BITS = 12, 12
_SIDE, _BITS = 0x7FF, 0xFFF
ROW_WORD, EVENT, FIRST, GROUP_12, GROUP_8, TIME_LOW, CONTINUED_4, TIME_HIGH = 0, 2, 3, 4, 5, 6, 7, 8
_TRIGGER, _OTHERS = 10, 14


class Evt3Reader(WordReader):
    """Reads EVT 3.0."""

    format_name = "EVT3"

    def __init__(self, path: Path, file: BinaryIO, size_px: tuple[int, int] | None) -> None:
        super().__init__(path, file, np.uint16, decode, size_px)


@numba.njit(cache=True, nogil=True)
def _leap(words: npt.NDArray[np.uint16], k: int, high: int, state: IntArray) -> int:
    """Return what leap from `high` the time of word `k` is, by the next time."""
    new, after = np.int64(words[k]) & _BITS, np.int64(-1)
    if not leaps(new, high, LOW_BITS):
        return NO_LEAP
    for j in range(k + 1, len(words)):
        word = np.int64(words[j])
        if word >> 12 == TIME_HIGH:
            after = word & _BITS
            break
    return kind_of_leap((high, new, after), 1 << HIGH_BITS, len(words) - k, state)


@numba.njit(cache=True, nogil=True)
def decode(
    words: npt.NDArray[np.uint16], state: IntArray, out: Columns, triggers: Triggers, limits: Limits
) -> int:
    """Decode words until they, or the room, end; see `decoding.Decode`."""
    n, m = state[FILLED], state[TRIGGERS]
    high, low, turns = state[HIGH], state[LOW], state[WRAPS]
    row, base, polarity = state[ROW], state[BASE], state[POLARITY]
    last, previous = state[LAST], state[PREVIOUS]
    time = (((turns << HIGH_BITS) + high) << LOW_BITS) + low
    ready = high >= 0 and row >= 0
    timed = n  # first event of the own time `time`, where that is not the latest one
    used = len(words)
    for k in range(len(words)):
        word = np.int64(words[k])
        kind = word >> 12
        if kind == EVENT:
            if n + MOST_OF_A_WORD > len(out.t):
                used = k
                break
            x = word & _SIDE
            if is_kept(x, row, ready, limits, state):
                n = put_event(out, n, last, x, row, (word >> 11) & 1)
        elif kind == ROW_WORD:
            row = word & _SIDE
            ready = high >= 0
        elif kind == TIME_LOW:
            if time < last and n > timed:
                hold(n - timed, time, last, state)
            low = word & _BITS
            time = (((turns << HIGH_BITS) + high) << LOW_BITS) + low
            if high >= 0:
                if time < last:
                    timed = n
                    if time < previous:
                        state[BACKWARDS] += 1
                else:
                    last = time
                previous = time
        elif kind == FIRST:
            base = word & _SIDE
            polarity = (word >> 11) & 1
        elif kind in (GROUP_12, GROUP_8):
            if n + MOST_OF_A_WORD > len(out.t):
                used = k
                break
            width = 12 if kind == GROUP_12 else 8
            bits = word & ((1 << width) - 1)
            x = base
            base += width
            while bits:
                if bits & 1 and is_kept(x, row, ready, limits, state):
                    n = put_event(out, n, last, x, row, polarity)
                bits >>= 1
                x += 1
        elif kind == TIME_HIGH:
            new = word & _BITS
            if new != high:
                leap = _leap(words, k, high, state)
                if leap == LONE:
                    continue
                if leap == OPEN:
                    used = k
                    break
                if time < last and n > timed:
                    hold(n - timed, time, last, state)
                turns = turns_of_counter(new, high, turns, (HIGH_BITS, LOW_BITS), state)
                high = new
                low = 0  # the low bits follow; events before them lie at the beginning of these 4 ms
                time = ((turns << HIGH_BITS) + high) << LOW_BITS
                if time < last:
                    timed = n
                    if time < previous:
                        state[BACKWARDS] += 1
                else:
                    last = time
                previous = time
                ready = row >= 0
        elif kind == _TRIGGER:
            if high < 0:
                state[UNTIMED] += 1
                continue
            if m == len(triggers.t_us):
                used = k
                break
            m = put_edge(triggers, m, time, (word >> 8) & 0xF, word & 1)
        elif kind < _OTHERS and kind != CONTINUED_4:
            state[UNKNOWN] += 1
    if time < last and n > timed:
        hold(n - timed, time, last, state)
    state[FILLED], state[TRIGGERS] = n, m
    state[HIGH], state[LOW], state[WRAPS] = high, low, turns
    state[ROW], state[BASE], state[POLARITY] = row, base, polarity
    state[LAST], state[PREVIOUS] = last, previous
    return used
