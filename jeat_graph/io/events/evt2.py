"""EVT 2.0, Prophesee's raw format of 32-bit words: an event each, the high bits of the time in words between.

==========================  ======  ==========================================================================
word, bits 31..28           value   bits below
==========================  ======  ==========================================================================
darker, brighter            0, 1    27..22 low bits of the time (µs), 21..11 column, 10..0 row
time                        8       27..0 bits 33..6 of the time; it begins again after 4 h 46 min
edge of a signal            10      27..22 low bits of the time, 12..8 channel, 0 value
others, continued           14, 15  what the camera says about itself; passed over
==========================  ======  ==========================================================================

Source: https://docs.prophesee.ai/stable/data/encoding_formats/evt2.html
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, BinaryIO

import numba
import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import IntArray
from jeat_graph.io.events.decoding import (
    BACKWARDS,
    FILLED,
    HIGH,
    LAST,
    LONE,
    NO_LEAP,
    OPEN,
    PREVIOUS,
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

HIGH_BITS, LOW_BITS = 28, 6
HIGH_MASK = (1 << HIGH_BITS) - 1
SIDE = 0x7FF
TIME, EDGE, OTHERS = 8, 10, 14


class Evt2Reader(WordReader):
    """Reads EVT 2.0."""

    format_name = "EVT2"

    def __init__(self, path: Path, file: BinaryIO, size_px: tuple[int, int] | None) -> None:
        super().__init__(path, file, np.uint32, decode, size_px)


@numba.njit(cache=True, nogil=True)
def upper_time(state: IntArray) -> int:
    """Return the time (µs) without the low bits, which events and edges have; negative if none is known."""
    return int(((state[WRAPS] << HIGH_BITS) + state[HIGH]) << LOW_BITS)


@numba.njit(cache=True, nogil=True)
def lower_time(word: Any) -> int:
    """Return the low bits of the time (µs) of an event or edge."""
    return int((word >> 22) & 0x3F)


@numba.njit(cache=True, nogil=True)
def take_other(word: Any, triggers: Triggers, state: IntArray) -> bool:
    """Take a word that is no event into the state; False if it is an edge and there is no room for it."""
    kind = word >> 28
    if kind == TIME:
        new = word & HIGH_MASK
        state[WRAPS] = turns_of_counter(new, state[HIGH], state[WRAPS], (HIGH_BITS, LOW_BITS), state)
        state[HIGH] = new
    elif kind == EDGE:
        if state[HIGH] < 0:
            state[UNTIMED] += 1
        elif state[TRIGGERS] == len(triggers.t_us):
            return False
        else:
            edge = (upper_time(state) + lower_time(word), (word >> 8) & 0x1F, word & 1)
            state[TRIGGERS] = put_edge(triggers, state[TRIGGERS], *edge)
    elif kind < OTHERS:
        state[UNKNOWN] += 1
    return True


@numba.njit(cache=True, nogil=True)
def _leap(words: npt.NDArray[np.uint32], k: int, state: IntArray) -> int:
    """Return what leap the time of word `k` is, by the next time."""
    old, new, after = state[HIGH], np.int64(words[k]) & HIGH_MASK, np.int64(-1)
    if not leaps(new, old, LOW_BITS):
        return NO_LEAP
    for j in range(k + 1, len(words)):
        word = np.int64(words[j])
        if word >> 28 == TIME:
            after = word & HIGH_MASK
            break
    return kind_of_leap((old, new, after), 1 << HIGH_BITS, len(words) - k, state)


@numba.njit(cache=True, nogil=True)
def decode(
    words: npt.NDArray[np.uint32], state: IntArray, out: Columns, triggers: Triggers, limits: Limits
) -> int:
    """Decode words until they, or the room, end; see `decoding.Decode`."""
    n = state[FILLED]
    last, previous = state[LAST], state[PREVIOUS]
    time = upper_time(state)
    used = len(words)
    for k in range(len(words)):
        word = np.int64(words[k])
        kind = word >> 28
        if kind < 2:
            if n == len(out.t):
                used = k
                break
            x = (word >> 11) & SIDE
            y = word & SIDE
            if is_kept(x, y, time >= 0, limits, state):
                t = time + lower_time(word)
                if t < last:
                    hold(1, t, last, state)
                    if t < previous:
                        state[BACKWARDS] += 1
                else:
                    last = t
                previous = t
                n = put_event(out, n, last, x, y, kind)
        else:
            leap = _leap(words, k, state) if kind == TIME else NO_LEAP
            if leap == LONE:
                continue
            if leap == OPEN or not take_other(word, triggers, state):
                used = k
                break
            time = upper_time(state)
    state[FILLED], state[LAST], state[PREVIOUS] = n, last, previous
    return used
