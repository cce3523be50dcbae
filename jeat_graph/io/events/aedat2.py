"""AEDAT 2.0, the format of jAER: a header of lines with `#`, then big-endian words of address and time (µs).

==========  ==================================================================================================
DAVIS       31 set: a sample of a frame or of the inertial sensors, passed over; 30..22 row, 21..12 column,
            11 polarity, 10 set: an edge of a signal
DVS128      15 set: an edge of a signal; 14..8 row, 7..1 column, 0 polarity
==========  ==================================================================================================

Rows count from the bottom and columns from the right; here they count from the top left, as in pictures.
The polarity bit of a DAVIS is 1 where it became brighter, that of a DVS128 where it became darker.
Times of 32 bits begin again after 71 min. The header names the camera (`AEChip`), if jAER wrote it.
Source: https://docs.inivation.com/software/software-advanced-usage/file-formats/aedat-2.0.html
"""

from __future__ import annotations

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
    JUMP_US,
    LAST,
    TRIGGERS,
    WRAPS,
    Columns,
    Limits,
    hold,
    is_kept,
    put_edge,
    put_event,
    turns_of_clock,
)
from jeat_graph.io.events.reader import Triggers, agreed_size
from jeat_graph.io.events.words import WordReader

#: Pictures of the cameras by what their names hold, in lower case.
CAMERAS = {
    "davis240": (240, 180),
    "davis346": (346, 260),
    "davis640": (640, 480),
    "dvs128": (128, 128),
    "tmpdiff128": (128, 128),
}
_DVS128 = (128, 128)
_END = b"# End Of ASCII Header"
_MOST_HEADER_LINES = 10_000
_MOST_LINE_BYTES = 1 << 16


class Aedat2Reader(WordReader):
    """Reads AEDAT 2.0.

    Args:
        path: the file.
        file: open, at its beginning.
        size_px: width and height of the picture, if the user says.

    Raises:
        DataError: neither the header nor the user tells the camera, so that addresses cannot be read.
    """

    format_name = "AEDAT2"

    def __init__(self, path: Path, file: BinaryIO, size_px: tuple[int, int] | None) -> None:
        header = _header(file)
        named = next((size for name, size in CAMERAS.items() if name in header), None)
        size = agreed_size(size_px, named, path)
        if size is None:
            raise DataError(
                "does not say which camera recorded it, so its addresses cannot be read; give the size of "
                f"its picture, one of {', '.join(f'{w}x{h}' for w, h in sorted(set(CAMERAS.values())))}",
                path,
            )
        decode = decode_dvs128 if (named or size) == _DVS128 else decode_davis
        super().__init__(path, file, np.uint64, decode, size)


def _header(file: BinaryIO) -> str:
    """Read the lines of the header, in lower case; the file then stands at the first word."""
    lines: list[bytes] = []
    while len(lines) < _MOST_HEADER_LINES:
        at = file.tell()
        line = file.readline(_MOST_LINE_BYTES)
        if not line.startswith(b"#") or not line.endswith(b"\n"):
            file.seek(at)
            break
        lines.append(line)
        if line.startswith(_END):
            break
    return b"".join(lines).decode("latin-1").lower()


@numba.njit(cache=True, nogil=True)
def _swap(word: np.uint64) -> np.int64:
    """Turn a 32-bit word from big-endian."""
    w = np.int64(word)
    return ((w & 0xFF) << 24) | ((w & 0xFF00) << 8) | ((w >> 8) & 0xFF00) | (w >> 24)


@numba.njit(cache=True, nogil=True)
def _decode(
    words: npt.NDArray[np.uint64],
    state: IntArray,
    out: Columns,
    triggers: Triggers,
    limits: Limits,
    davis: bool,
) -> int:
    """Decode words until they, or the room, end; see `decoding.Decode`."""
    n, m, turns = state[FILLED], state[TRIGGERS], state[WRAPS]
    last, low = state[LAST], state[HIGH]
    time = turns << CLOCK_BITS
    used = len(words)
    for k in range(len(words)):
        address = _swap(words[k] & np.uint64(0xFFFFFFFF))
        new = _swap(words[k] >> np.uint64(32))
        if davis and address >> 31:
            continue
        special = (address >> 10) & 1 if davis else (address >> 15) & 1
        if n == len(out.t) or m == len(triggers.t_us):
            used = k
            break
        if davis:
            x, y, polarity = (address >> 12) & 0x3FF, (address >> 22) & 0x1FF, (address >> 11) & 1
        else:
            x, y, polarity = (address >> 1) & 0x7F, (address >> 8) & 0x7F, 1 - (address & 1)
        if not special and not is_kept(x, y, True, limits, state):
            continue
        if not low <= new <= low + JUMP_US:
            turns = turns_of_clock(new, low, turns, state)
            time = turns << CLOCK_BITS
        low = new
        t = time + new
        if t < last and not special:
            hold(1, t, last, state)
        last = max(t, last)
        if special:
            m = put_edge(triggers, m, last, 0, polarity)
        else:
            n = put_event(out, n, last, limits.width - 1 - x, limits.height - 1 - y, polarity)
    state[FILLED], state[TRIGGERS], state[WRAPS] = n, m, turns
    state[LAST], state[HIGH] = last, low
    return used


# Compiled with the camera as a constant: a fifth faster than with it as an argument.


@numba.njit(cache=True, nogil=True)
def decode_davis(
    words: npt.NDArray[np.uint64], state: IntArray, out: Columns, triggers: Triggers, limits: Limits
) -> int:
    """Decode events of a DAVIS; see `decoding.Decode`."""
    return int(_decode(words, state, out, triggers, limits, True))


@numba.njit(cache=True, nogil=True)
def decode_dvs128(
    words: npt.NDArray[np.uint64], state: IntArray, out: Columns, triggers: Triggers, limits: Limits
) -> int:
    """Decode events of a DVS128; see `decoding.Decode`."""
    return int(_decode(words, state, out, triggers, limits, False))
