"""Writes EVT 2.0 (see `evt2`)."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numba
import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import IntArray
from jeat_graph.io.events.evt2 import HIGH_BITS, LOW_BITS
from jeat_graph.io.events.raw_header import raw_header
from jeat_graph.io.events.word_writer import Layout, WordWriter

_TIME_WORD = 8 << 28


@numba.njit(cache=True, nogil=True)
def encode(
    t: IntArray,
    x: npt.NDArray[np.uint16],
    y: npt.NDArray[np.uint16],
    p: npt.NDArray[np.uint8],
    words: npt.NDArray[np.uint32],
    state: IntArray,
) -> tuple[int, int]:
    """Encode events; `state[0]` is the high part of the time, not wrapped, -1 before the first."""
    n = 0
    high = state[0]
    full = (1 << HIGH_BITS) - 1
    for k in range(len(t)):
        if n + 4 > len(words):
            state[0] = high
            return k, n
        new = t[k] >> LOW_BITS
        if new != high:
            # Readers see that the counter began again by its last and its first value.
            if high >= 0 and new >> HIGH_BITS != high >> HIGH_BITS:
                words[n] = _TIME_WORD | full
                words[n + 1] = _TIME_WORD
                n += 2
            words[n] = _TIME_WORD | (new & full)
            n += 1
            high = new
        low = t[k] & ((1 << LOW_BITS) - 1)
        words[n] = (np.int64(p[k] > 0) << 28) | (low << 22) | (np.int64(x[k]) << 11) | np.int64(y[k])
        n += 1
    state[0] = high
    return len(t), n


class Evt2Writer(WordWriter):
    """Writes EVT 2.0; gaps of more than 4 h 46 min lose that much."""

    def __init__(self, path: str | Path, size_px: tuple[int, int]) -> None:
        layout = Layout(partial(raw_header, "2.0"), np.uint32, 1 << 11, encode)
        super().__init__(path, size_px, layout)
