"""Writes DAT (see `dat`)."""

from __future__ import annotations

from pathlib import Path

import numba
import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import IntArray
from jeat_graph.io.events.dat import EVENT_BYTES, PIXELS_12
from jeat_graph.io.events.word_writer import Layout, WordWriter

_SIDE_BITS = 14


def header(size_px: tuple[int, int]) -> bytes:
    """Return the header of a file, with the two bytes that tell what follows."""
    width, height = size_px
    text = f"% Data file containing CD events.\n% Version 2\n% Height {height}\n% Width {width}\n"
    return text.encode("ascii") + bytes((PIXELS_12, EVENT_BYTES))


@numba.njit(cache=True, nogil=True)
def encode(
    t: IntArray,
    x: npt.NDArray[np.uint16],
    y: npt.NDArray[np.uint16],
    p: npt.NDArray[np.uint8],
    words: npt.NDArray[np.uint64],
    state: IntArray,
) -> tuple[int, int]:
    """Encode events; nothing is kept from one call to the next."""
    count = min(len(t), len(words))
    for k in range(count):
        address = (np.int64(p[k] > 0) << (2 * _SIDE_BITS)) | (np.int64(y[k]) << _SIDE_BITS) | np.int64(x[k])
        words[k] = np.uint64((address << 32) | (t[k] & 0xFFFFFFFF))
    return count, count


class DatWriter(WordWriter):
    """Writes DAT; gaps of more than 35 min lose time, because its clock begins again after 71 min."""

    def __init__(self, path: str | Path, size_px: tuple[int, int]) -> None:
        super().__init__(path, size_px, Layout(header, np.uint64, 1 << _SIDE_BITS, encode))
