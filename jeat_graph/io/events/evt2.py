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


class Evt2Reader(WordReader):
    """Reads EVT 2.0."""

    format_name = "EVT2"

    def __init__(self, path: Path, file: BinaryIO, size_px: tuple[int, int] | None) -> None:
        super().__init__(path, file, np.uint32, decode, size_px)


@numba.njit(cache=True)
def decode(
    words: npt.NDArray[np.uint32], state: IntArray, out: Columns, triggers: Triggers, limits: Limits
) -> int:
    """Decode words until they, or the room, end; see `words.Decode`."""
    n, m = state[FILLED], state[TRIGGERS]
    high, turns = state[HIGH], state[WRAPS]
    last, previous = state[LAST], state[PREVIOUS]
    time = ((turns << HIGH_BITS) + high) << LOW_BITS
    used = len(words)
    for k in range(len(words)):
        word = np.int64(words[k])
        kind = word >> 28
        if kind < 2:
            if n == len(out.t):
                used = k
                break
            x = (word >> 11) & _SIDE
            y = word & _SIDE
            if high < 0:
                state[UNTIMED] += 1
                continue
            if x >= limits.width or y >= limits.height:
                state[OUTSIDE] += 1
                continue
            t = time + ((word >> 22) & 0x3F)
            if t < previous:
                state[BACKWARDS] += 1
            previous = t
            last = max(t, last)
            out.t[n] = last
            out.x[n] = x
            out.y[n] = y
            out.p[n] = kind
            n += 1
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
