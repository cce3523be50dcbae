"""DAT, Prophesee's older format: a header of lines with `%`, two bytes, then eight bytes an event.

==================  ==========================================================================================
two bytes           kind of event (0 or 12: of pixels; 14: edges of signals), and 8, the bytes of one
bytes 0 to 3        time (µs); it begins again after 71 min
bytes 4 to 7        13..0 column, 27..14 row, 31..28 polarity; in files of version 1 8..0 column, 16..9 row,
                    17 polarity
==================  ==========================================================================================

Source: https://docs.prophesee.ai/stable/data/file_formats/dat.html
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import BinaryIO

import numba
import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.io.events.decoding import (
    CLOCK_BITS,
    FILLED,
    HIGH,
    LAST,
    LEAP_US,
    LONE,
    NO_LEAP,
    OPEN,
    UNKNOWN,
    WRAPS,
    Columns,
    Decode,
    Limits,
    hold,
    is_kept,
    kind_of_leap,
    leaps,
    put_event,
    turns_of_clock,
)
from jeat_graph.io.events.reader import Triggers
from jeat_graph.io.events.words import WordReader

EVENT_BYTES = 8
PIXELS, PIXELS_12, EDGES = 0, 12, 14


class DatReader(WordReader):
    """Reads DAT.

    Args:
        path: the file.
        file: open, at the two bytes that follow the header.
        size_px: width and height of the picture, if known.
        version: what the header says, 2 if it says nothing.

    Raises:
        DataError: the two bytes announce something else than events of pixels.
    """

    format_name = "DAT"

    def __init__(self, path: Path, file: BinaryIO, size_px: tuple[int, int] | None, version: int = 2) -> None:
        kind = file.read(2)
        if len(kind) == 2 and kind[0] == EDGES:
            raise DataError("holds edges of signals (event type 14), no events of pixels", path)
        if len(kind) < 2:
            raise DataError("ends in its header: the file is cut off", path)
        if kind[0] not in (PIXELS, PIXELS_12) or kind[1] != EVENT_BYTES:
            raise DataError(
                f"is not DAT: its header must be followed by the type of events, 0 or 12, and their size, 8, "
                f"not by {list(kind)}",
                path,
            )
        super().__init__(path, file, np.uint64, decode_first if version < 2 else decode, size_px)


@numba.njit(cache=True, nogil=True)
def _leap(words: npt.NDArray[np.uint64], k: int, old: int, state: IntArray) -> int:
    """Return what leap from `old` the time of word `k` is, by the next one."""
    new = np.int64(words[k] & np.uint64(0xFFFFFFFF))
    if not leaps(new, old, 0):
        return NO_LEAP
    after = np.int64(words[k + 1] & np.uint64(0xFFFFFFFF)) if k + 1 < len(words) else np.int64(-1)
    return kind_of_leap((old, new, after), 1 << CLOCK_BITS, len(words) - k, state)


@numba.njit(cache=True, nogil=True)
def _decode(
    words: npt.NDArray[np.uint64],
    state: IntArray,
    out: Columns,
    triggers: Triggers,
    limits: Limits,
    x_bits: int,
    y_bits: int,
) -> int:
    """Decode words until they, or the room, end; see `decoding.Decode`."""
    n, turns = state[FILLED], state[WRAPS]
    last, low = state[LAST], state[HIGH]
    time = turns << CLOCK_BITS
    latest = max(low, last - time)  # the latest time on this turn of the clock; after a step back not `low`
    used = len(words)
    for k in range(len(words)):
        if n == len(out.t):
            used = k
            break
        new = np.int64(words[k] & np.uint64(0xFFFFFFFF))
        address = np.int64(words[k] >> np.uint64(32))
        x = address & ((1 << x_bits) - 1)
        y = (address >> x_bits) & ((1 << y_bits) - 1)
        polarity = address >> (x_bits + y_bits)
        if polarity > 1:
            state[UNKNOWN] += 1
            continue
        if not is_kept(x, y, True, limits, state):
            continue
        if not latest <= new <= low + LEAP_US:
            leap = _leap(words, k, low, state)
            if leap == OPEN:
                used = k
                break
            if leap == LONE:
                new = low
            elif not low <= new <= low + LEAP_US:
                turns = turns_of_clock(new, low, turns, state)
                time = turns << CLOCK_BITS
            if time + new < last:
                hold(1, time + new, last, state)
            latest = max(new, last - time)
        else:
            latest = new
        low = new
        last = time + latest
        n = put_event(out, n, last, x, y, polarity)
    state[FILLED], state[WRAPS] = n, turns
    state[LAST], state[HIGH] = last, low
    return used


decode: Decode = partial(_decode, x_bits=14, y_bits=14)
#: Of version 1, of cameras of 304 x 240 px.
decode_first: Decode = partial(_decode, x_bits=9, y_bits=8)
