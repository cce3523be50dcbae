"""Links marked pixels that lie near one another into groups.

Two pixels belong together where neither their columns nor their rows are farther apart than `link_px`: that
is what a dilation by a square of that side and components of eight neighbours say. A row of a picture is kept
as bits here, so that 64 pixels are dilated at once, and what touches in a row of the dilated picture is one
run. Runs are few; those of neighbouring rows are joined in a forest of disjoint sets, and each marked pixel
asks its run.
Sources: He, Chao and Suzuki, "A run-based two-scan labeling algorithm" (2008); Tarjan, "Efficiency
of a good but not linear set union algorithm" (1975).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numba
import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from jeat_graph.data.arrays import IntArray
from jeat_graph.detection.components import Marked, Whole

_WORD = 64
_Bits = npt.NDArray[np.uint64]


class MarkedPixels(NamedTuple):
    """Marked pixels of a picture of H rows, row by row, before they are linked.

    Attributes:
        bits: (H, B) the picture's rows, a bit a pixel, from the lowest of the first; the last word is empty.
        x: (P,) columns (px).
        weight: (P,) their marks.
        start: (H + 1,) where each row begins.
        total: sum of all marks.
    """

    bits: _Bits
    x: Whole
    weight: Whole
    start: IntArray
    total: int


def marked_pixels(marks: npt.NDArray[Any]) -> MarkedPixels:
    """Collect the pixels of a picture (H, W) that are marked, which is positive."""
    height, width = marks.shape
    little = np.zeros((height, -(-width // _WORD) + 1), dtype="<u8")
    packed = np.packbits(marks > 0, axis=1, bitorder="little")
    little.view(np.uint8)[:, : packed.shape[1]] = packed
    bits = little.astype(np.uint64, copy=False)
    return MarkedPixels(bits, *_collected(bits, marks))


def linked(pixels: MarkedPixels, link_px: int, least_weight: float = 0.0) -> tuple[int, Marked]:
    """Number the groups of marked pixels: two belong together across a gap of less than `link_px`.

    Groups are numbered as by a labelling in blocks of 2 x 2 pixels: by the first block, row by row, that the
    dilated group touches. This is OpenCV's order.

    Args:
        pixels: those that are marked.
        link_px: the gap (px), along rows and columns.
        least_weight: groups whose marks have a smaller sum are left out.

    Returns:
        The number of groups, and their pixels.
    """
    count, *columns = _linked(pixels.bits, pixels.x, pixels.weight, pixels.start, link_px, least_weight)
    return count, Marked(*columns)


def _count_trailing_zeros(context: Any, word: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.cttz(arguments[0], ir.Constant(ir.IntType(1), 0))

    return types.int64(types.uint64), code


#: Number of the lowest bit of a word that is set; 64 where none is.
_lowest_bit: Any = intrinsic(_count_trailing_zeros)


@numba.njit(cache=True, nogil=True)
def _collected(bits: _Bits, marks: Any) -> Any:
    """Columns and marks (P,) of the marked pixels, where rows begin (H + 1,), and the sum of the marks."""
    height, words = bits.shape
    start = np.empty(height + 1, dtype=np.int64)
    columns = np.empty(bits.size * _WORD, dtype=np.int32)
    k, total = np.int64(0), np.int64(0)
    for row in range(height):
        start[row] = k
        for n in range(words):
            word = bits[row, n]
            while word:
                columns[k] = n * _WORD + _lowest_bit(word)
                word &= word - np.uint64(1)
                k += 1
    start[height] = k
    weight = np.empty(k, dtype=np.int32)
    for row in range(height):
        for p in range(start[row], start[row + 1]):
            weight[p] = marks[row, columns[p]]
            total += weight[p]
    return columns[:k].copy(), weight, start, total


@numba.njit(cache=True, nogil=True)
def _linked(
    bits: _Bits, x: Whole, weight: Whole, start: IntArray, link: int, least: float
) -> tuple[Any, Any, Any, Any, Any]:
    """Number of groups with enough weight; columns, rows, groups and marks of their pixels."""
    height = len(start) - 1
    first, last, begin = _dilated_runs(bits, link)
    parent = _joined(first, last, begin, link)
    run = np.empty(len(x), dtype=np.int32)
    size = np.zeros(len(parent), dtype=np.int64)
    for row in range(height):
        r = begin[row]
        for p in range(start[row], start[row + 1]):
            while last[r] < x[p]:
                r += 1
            run[p] = parent[r]
            size[parent[r]] += weight[p]
    number, count = _numbered(parent, size, first, begin, link, least)
    columns, rows = np.empty(len(x), dtype=np.int32), np.empty(len(x), dtype=np.int32)
    groups, marks = np.empty(len(x), dtype=np.int32), np.empty(len(x), dtype=np.int32)
    k = 0
    for row in range(height):
        for p in range(start[row], start[row + 1]):
            # Written before it is known whether it counts: no branch that is guessed wrongly.
            group = number[run[p]]
            columns[k], rows[k], groups[k], marks[k] = x[p], row, group, weight[p]
            k += group > 0
    return count, columns[:k], rows[:k], groups[:k], marks[:k]


@numba.njit(cache=True, nogil=True)
def _dilated_runs(bits: _Bits, link: int) -> tuple[Any, Any, Any]:
    """Runs (R,) of the dilated picture: first and last column before it grows sideways, and rows (H + 1,).

    A dilation reaches `link // 2` px to the right and down, and the rest of its side to the left and up.
    """
    height, words = bits.shape
    most = height * (words * (_WORD // 2) + 1)
    first, last = np.empty(most, dtype=np.int32), np.empty(most, dtype=np.int32)
    begin = np.empty(height + 1, dtype=np.int64)
    line = np.empty(words, dtype=np.uint64)
    down, up = link // 2, link - 1 - link // 2
    smear = min(link, _WORD) - 1  # columns that are set behind each: gaps close
    r = 0
    for row in range(height):
        begin[row] = r
        line[:] = 0
        for near in range(max(row - down, 0), min(row + up, height - 1) + 1):
            for n in range(words):
                line[n] |= bits[near, n]
        _smear(line, smear)
        set_before = np.uint64(0)
        for n in range(words):
            word = line[n]
            edges = word ^ ((word << np.uint64(1)) | set_before)
            set_before = word >> np.uint64(_WORD - 1)
            while edges:
                column = n * _WORD + _lowest_bit(edges)
                if (word >> np.uint64(column - n * _WORD)) & np.uint64(1):
                    if r > begin[row] and column - last[r - 1] <= link:
                        r -= 1  # wider gaps than a word closes
                    else:
                        first[r] = column
                else:
                    last[r] = column - 1 - smear
                    r += 1
                edges &= edges - np.uint64(1)
    begin[height] = r
    return first[:r], last[:r], begin


@numba.njit(cache=True, nogil=True)
def _smear(line: _Bits, columns: int) -> None:
    """Set the bits up to `columns` (less than 64) behind each that is set, twice as far each time."""
    done = 0
    while done < columns:
        step = min(done + 1, columns - done)
        for n in range(len(line) - 1, 0, -1):
            line[n] |= (line[n] << np.uint64(step)) | (line[n - 1] >> np.uint64(_WORD - step))
        line[0] |= line[0] << np.uint64(step)
        done += step


@numba.njit(cache=True, nogil=True)
def _joined(first: Whole, last: Whole, begin: IntArray, link: int) -> Any:
    """For each run (R,) the first run of its group: those of neighbouring rows that touch are of one."""
    parent = np.arange(len(first))
    for row in range(1, len(begin) - 1):
        a, b = begin[row], begin[row - 1]
        while a < begin[row + 1] and b < begin[row]:
            if first[b] - last[a] > link:
                a += 1
            elif first[a] - last[b] > link:
                b += 1
            else:
                one, other = _root(parent, a), _root(parent, b)
                parent[max(one, other)] = min(one, other)
                if last[a] < last[b]:
                    a += 1
                else:
                    b += 1
    for r in range(len(parent)):
        parent[r] = parent[parent[r]]  # a parent comes first, and knows its root by now
    return parent


@numba.njit(cache=True, nogil=True)
def _root(parent: IntArray, r: int) -> int:
    """Return the run that stands for the group of a run, and halve the way to it."""
    while parent[r] != r:
        parent[r] = parent[parent[r]]
        r = parent[r]
    return r


@numba.njit(cache=True, nogil=True)
def _numbered(
    parent: IntArray, size: IntArray, first: Whole, begin: IntArray, link: int, least: float
) -> tuple[Any, int]:
    """Number (R,) of each group at its first run, from 1 in the order of blocks; 0 where it is too light."""
    left = link - 1 - link // 2
    place = np.full(len(parent), np.iinfo(np.int64).max)
    for row in range(len(begin) - 1):
        for r in range(begin[row], begin[row + 1]):
            block = (np.int64(row // 2) << 32) + max(first[r] - left, 0) // 2
            place[parent[r]] = min(place[parent[r]], block)
    roots = np.flatnonzero((parent == np.arange(len(parent))) & (size >= least))
    number = np.zeros(len(parent), dtype=np.int32)
    order = np.argsort(place[roots])
    for k in range(len(roots)):
        number[roots[order[k]]] = k + 1
    return number, len(roots)
