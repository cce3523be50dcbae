"""Writes EVT 3.0 (see `evt3`): runs of events of one row, time and polarity become groups of columns."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numba
import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import IntArray
from jeat_graph.io.events.evt3 import (
    EVENT,
    FIRST,
    GROUP_8,
    GROUP_12,
    HIGH_BITS,
    LOW_BITS,
    ROW_WORD,
    TIME_HIGH,
    TIME_LOW,
)
from jeat_graph.io.events.raw_header import raw_header
from jeat_graph.io.events.word_writer import Layout, WordWriter

_BITS = 0xFFF
_LEAST_RUN = 4  # a group costs two words, an event one
_MOST_WORDS = 8  # of one step, the words of a time that moves on apart
_SPAN_12, _SPAN_8 = 12, 8
_HIGH, _LOW, _ROW = 0, 1, 2


@numba.njit(cache=True, nogil=True)
def _run(
    t: IntArray, x: npt.NDArray[np.uint16], y: npt.NDArray[np.uint16], p: npt.NDArray[np.uint8], k: int
) -> int:
    """Return how many events from k on fit into one group of 12: same row, time and polarity, x ascending."""
    end = k + 1
    while (
        end < len(t)
        and t[end] == t[k]
        and y[end] == y[k]
        and p[end] == p[k]
        and x[end] > x[end - 1]
        and x[end] - x[k] < _SPAN_12
    ):
        end += 1
    return end - k


@numba.njit(cache=True, nogil=True)
def encode(
    t: IntArray,
    x: npt.NDArray[np.uint16],
    y: npt.NDArray[np.uint16],
    p: npt.NDArray[np.uint8],
    words: npt.NDArray[np.uint16],
    state: IntArray,
) -> tuple[int, int]:
    """Encode events; the state holds high part of the time (not wrapped), low part and row, -1 before."""
    n = k = 0
    high, low, row = state[_HIGH], state[_LOW], state[_ROW]
    while k < len(t):
        if n + _MOST_WORDS > len(words):
            break
        new = t[k] >> LOW_BITS
        # The counter has only 16.8 s: each of its steps is written, as cameras do, so that none is missed.
        if new != high:
            high = high + 1 if high >= 0 else new
            words[n] = (TIME_HIGH << 12) | (high & ((1 << HIGH_BITS) - 1))
            n += 1
            low = -1
            continue
        if (t[k] & _BITS) != low:
            low = t[k] & _BITS
            words[n] = (TIME_LOW << 12) | low
            n += 1
        if y[k] != row:
            row = np.int64(y[k])
            words[n] = (ROW_WORD << 12) | row
            n += 1
        polarity = np.int64(p[k] > 0) << 11
        count = _run(t, x, y, p, k)
        if count >= _LEAST_RUN:
            mask = np.int64(0)
            for j in range(k, k + count):
                mask |= 1 << (np.int64(x[j]) - np.int64(x[k]))
            words[n] = (FIRST << 12) | polarity | x[k]
            words[n + 1] = ((GROUP_8 if mask < 1 << _SPAN_8 else GROUP_12) << 12) | mask
            n += 2
            k += count
        else:
            words[n] = (EVENT << 12) | polarity | x[k]
            n += 1
            k += 1
    state[_HIGH], state[_LOW], state[_ROW] = high, low, row
    return k, n


class Evt3Writer(WordWriter):
    """Writes EVT 3.0."""

    def __init__(self, path: str | Path, size_px: tuple[int, int]) -> None:
        layout = Layout(partial(raw_header, "3.0"), np.uint16, 1 << 11, encode)
        super().__init__(path, size_px, layout)
