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

from pathlib import Path
from typing import BinaryIO

import numba
import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import IntArray
from jeat_graph.io.events.reader import Triggers
from jeat_graph.io.events.words import (
    BACKWARDS,
    FILLED,
    HIGH,
    JUMP_US,
    JUMPS,
    LAST,
    MOST_OF_A_WORD,
    OUTSIDE,
    PREVIOUS,
    TRIGGERS,
    UNKNOWN,
    UNTIMED,
    WRAPS,
    Columns,
    Limits,
    WordReader,
    wraps,
)

HIGH_BITS, LOW_BITS = 28, 6
_SIDE = 0x7FF
_TIME, _TRIGGER, _OTHERS = 8, 10, 14
_HALF = 32
_LOOKED_AT_BYTES = 1 << 16
_KNOWN_TYPES = (0, 1, _TIME, _TRIGGER, _OTHERS, 15)


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
    times = (halves == _TIME).sum(axis=0)
    first, second = (known + times).tolist()
    return bool(first > second)


@numba.njit(cache=True)
def _decode(
    words: npt.NDArray[np.uint64],
    state: IntArray,
    out: Columns,
    triggers: Triggers,
    limits: Limits,
    swapped: bool,
) -> int:
    n, m = state[FILLED], state[TRIGGERS]
    high, turns = state[HIGH], state[WRAPS]
    last, previous = state[LAST], state[PREVIOUS]
    time = ((turns << HIGH_BITS) + high) << LOW_BITS
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
            x = (word >> 11) & _SIDE
            y = word & _SIDE
            t = time + ((word >> 22) & 0x3F)
            if high >= 0 and low_half and y < limits.height:
                if t < previous:
                    state[BACKWARDS] += 1
                previous = t
                last = max(t, last)
            while low_half:
                if low_half & 1:
                    if high < 0:
                        state[UNTIMED] += 1
                    elif x >= limits.width or y >= limits.height:
                        state[OUTSIDE] += 1
                    else:
                        out.t[n] = last
                        out.x[n] = x
                        out.y[n] = y
                        out.p[n] = kind
                        n += 1
                low_half >>= 1
                x += 1
        elif kind == _TIME:
            new = word & 0xFFFFFFF
            if wraps(high, new, 1 << HIGH_BITS):
                turns += 1
            elif high >= 0 and new - high > JUMP_US >> LOW_BITS:
                state[JUMPS] += 1
            high = new
            time = ((turns << HIGH_BITS) + high) << LOW_BITS
        elif kind == _TRIGGER:
            if high < 0:
                state[UNTIMED] += 1
                continue
            if m == len(triggers.t_us):
                used = k
                break
            triggers.t_us[m] = time + ((word >> 22) & 0x3F)
            triggers.channel[m] = (word >> 8) & 0x1F
            triggers.value[m] = word & 1
            m += 1
        elif kind < _OTHERS:
            state[UNKNOWN] += 1
    state[FILLED], state[TRIGGERS] = n, m
    state[HIGH], state[WRAPS] = high, turns
    state[LAST], state[PREVIOUS] = last, previous
    return used


@numba.njit(cache=True)
def decode(
    words: npt.NDArray[np.uint64], state: IntArray, out: Columns, triggers: Triggers, limits: Limits
) -> int:
    """Decode words with their lower half first; see `words.Decode`."""
    return int(_decode(words, state, out, triggers, limits, False))


@numba.njit(cache=True)
def decode_swapped(
    words: npt.NDArray[np.uint64], state: IntArray, out: Columns, triggers: Triggers, limits: Limits
) -> int:
    """Decode words with their upper half first; see `words.Decode`."""
    return int(_decode(words, state, out, triggers, limits, True))
