"""EVT 2.1, Prophesee's raw format of 64-bit words: up to 32 events of one row, time and polarity in each.

==========================  ======  ==========================================================================
word, bits 63..60           value   bits below
==========================  ======  ==========================================================================
darker, brighter            0, 1    59..54 low bits of the time (µs), 53..43 first column, 42..32 row, 31..0 a
                                    bit for each column from the first, set for an event
time                        8       59..32 bits 33..6 of the time; it begins again after 4 h 46 min
edge of a signal            10      59..54 low bits of the time, 44..40 channel, 32 value
others, continued           14, 15  what the camera says about itself; passed over
==========================  ======  ==========================================================================

Some cameras send the upper half of each word first: the header calls that `endianness=legacy`, and where it
says nothing the halves are told apart by the types that they would be.
Source: https://docs.prophesee.ai/stable/data/encoding_formats/evt21.html
"""

from __future__ import annotations

from functools import partial
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
    MOST_OF_A_WORD,
    NO_LEAP,
    OPEN,
    PREVIOUS,
    Columns,
    Decode,
    Limits,
    hold,
    is_kept,
    kind_of_leap,
    leaps,
    put_event,
)
from jeat_graph.io.events.evt2 import (
    EDGE,
    HIGH_BITS,
    HIGH_MASK,
    LOW_BITS,
    OTHERS,
    SIDE,
    TIME,
    lower_time,
    take_other,
    upper_time,
)
from jeat_graph.io.events.reader import Triggers
from jeat_graph.io.events.words import WordReader

_HALF = 32
_LOOKED_AT_BYTES = 1 << 16
_KNOWN_TYPES = (0, 1, TIME, EDGE, OTHERS, 15)


class Evt21Reader(WordReader):
    """Reads EVT 2.1.

    Args:
        path: the file.
        file: open, at the first word.
        size_px: width and height of the picture, if known.
        swapped: whether the upper half of each word comes first; None where the header does not say.
    """

    format_name = "EVT2.1"

    def __init__(
        self, path: Path, file: BinaryIO, size_px: tuple[int, int] | None, swapped: bool | None = None
    ) -> None:
        if swapped is None:
            begin = file.tell()
            swapped = _looks_swapped(file.read(_LOOKED_AT_BYTES))
            file.seek(begin)
        super().__init__(path, file, np.uint64, decode_swapped if swapped else decode, size_px)


def _looks_swapped(data: bytes) -> bool:
    """Whether the types stand in the first half of each word: more of them are known there, or times."""
    halves = np.frombuffer(data[: len(data) // 8 * 8], np.uint32).reshape(-1, 2) >> 28
    known = np.isin(halves, _KNOWN_TYPES).sum(axis=0)
    times = (halves == TIME).sum(axis=0)
    first, second = (known + times).tolist()
    return bool(first > second)


@numba.njit(cache=True, nogil=True)
def _leap(words: npt.NDArray[np.uint64], k: int, state: IntArray, swapped: bool) -> int:
    """Return what leap the time of word `k` is, by the next time."""
    shift = np.uint64(0 if swapped else _HALF)
    old, after = state[HIGH], np.int64(-1)
    new = np.int64(words[k] >> shift) & HIGH_MASK
    if not leaps(new, old, LOW_BITS):
        return NO_LEAP
    for j in range(k + 1, len(words)):
        word = np.int64((words[j] >> shift) & np.uint64(0xFFFFFFFF))
        if word >> 28 == TIME:
            after = word & HIGH_MASK
            break
    return kind_of_leap((old, new, after), 1 << HIGH_BITS, len(words) - k, state)


@numba.njit(cache=True, nogil=True)
def _hold_columns(columns: Any, most: Any, times: tuple[Any, Any], state: IntArray) -> None:
    """Count the events of a word, bits of which the first `most` lie in the picture, as `decoding.hold`."""
    count = 0
    for k in range(min(most, _HALF)):
        count += (columns >> k) & 1
    if count:
        hold(count, times[0], times[1], state)


@numba.njit(cache=True, nogil=True)
def _decode(
    words: npt.NDArray[np.uint64],
    state: IntArray,
    out: Columns,
    triggers: Triggers,
    limits: Limits,
    swapped: bool,
) -> int:
    """Decode words till they or the room end (see `decoding.Decode`); the upper halves are words of EVT2."""
    n = state[FILLED]
    last, previous = state[LAST], state[PREVIOUS]
    time = upper_time(state)
    used = len(words)
    for k in range(len(words)):
        low_half = np.int64(words[k] & np.uint64(0xFFFFFFFF))
        word = np.int64(words[k] >> np.uint64(_HALF))
        if swapped:
            low_half, word = word, low_half
        kind = word >> 28
        if kind < 2:
            if n + MOST_OF_A_WORD > len(out.t):
                used = k
                break
            x = (word >> 11) & SIDE
            y = word & SIDE
            if time >= 0 and low_half and y < limits.height:
                t = time + lower_time(word)
                if t < previous:
                    state[BACKWARDS] += 1
                previous = t
                last = max(t, last)
                if t < last:
                    _hold_columns(low_half, limits.width - x, (t, last), state)
            while low_half:
                if low_half & 1 and is_kept(x, y, time >= 0, limits, state):
                    n = put_event(out, n, last, x, y, kind)
                low_half >>= 1
                x += 1
        else:
            leap = _leap(words, k, state, swapped) if kind == TIME else NO_LEAP
            if leap == LONE:
                continue
            if leap == OPEN or not take_other(word, triggers, state):
                used = k
                break
            time = upper_time(state)
    state[FILLED], state[LAST], state[PREVIOUS] = n, last, previous
    return used


decode: Decode = partial(_decode, swapped=False)
decode_swapped: Decode = partial(_decode, swapped=True)
