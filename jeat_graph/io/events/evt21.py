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
says nothing the halves are distinguished by the types that they would be.
Source: https://docs.prophesee.ai/stable/data/encoding_formats/evt21.html
"""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

import numpy as np

from jeat_graph.core import events
from jeat_graph.io.events.words import WordReader

_INSPECTED_BYTES = 1 << 16
_TIME = 8
_KNOWN_TYPES = (0, 1, _TIME, 10, 14, 15)


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
            swapped = _is_swapped(file.read(_INSPECTED_BYTES))
            file.seek(begin)
        decode = events.decode_evt21_swapped if swapped else events.decode_evt21
        super().__init__(path, file, np.uint64, decode, size_px)


def _is_swapped(data: bytes) -> bool:
    """Whether the types stand in the first half of each word: more of them are known there, or times."""
    halves = np.frombuffer(data[: len(data) // 8 * 8], np.uint32).reshape(-1, 2) >> 28
    known = np.isin(halves, _KNOWN_TYPES).sum(axis=0)
    times = (halves == _TIME).sum(axis=0)
    first, second = (known + times).tolist()
    return bool(first > second)
