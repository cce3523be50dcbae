"""Finds boxes around what belongs together: pixels that are marked and lie near one another."""

from __future__ import annotations

from typing import Any, NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray

#: Whole numbers of 32 bits: half of the memory that has to be gone through.
Whole = npt.NDArray[np.int32]


class Components(NamedTuple):
    """What was found.

    Attributes:
        boxes: (M, 4) left, top, width, height (px) of the marked pixels.
        weight: (M,) sum of their marks.
        pixels: (M,) number of them.
    """

    boxes: FloatArray
    weight: FloatArray
    pixels: IntArray

    def take(self, keep: BoolArray) -> Components:
        """Return some of them."""
        return Components(self.boxes[keep], self.weight[keep], self.pixels[keep])


class Marked(NamedTuple):
    """Marked pixels, row by row: few of a picture's, so that what is asked of them costs little.

    Attributes:
        x: (P,) columns (px); all four are of 32 bits.
        y: (P,) rows (px).
        group: (P,) number of the group that each belongs to, from 1; 0 for none.
        weight: (P,) its mark.
    """

    x: Whole
    y: Whole
    group: Whole
    weight: Whole


def measured(count: int, marked: Marked, trim_share: float = 0.0, *, keep_empty: bool = False) -> Components:
    """Measure groups by their marked pixels.

    Args:
        count: number of groups.
        marked: pixels; those with no weight are not marked.
        trim_share: columns at the left and right of a group that have fewer marked pixels than this share of
            its fullest column are not of its box, and so for rows: thin shadows, and noise.
        keep_empty: also return groups without a marked pixel, with boxes of no size, so that rows are groups.
    """
    corners, weight, pixels = _measure(count, marked, trim_share)
    found = (pixels > 0) | keep_empty
    corners[pixels == 0] = 0
    corners = corners[found].astype(np.float64)
    boxes = np.column_stack([corners[:, :2], corners[:, 2:] - corners[:, :2]])
    return Components(boxes.reshape(-1, 4), weight[found], pixels[found])


def without_inner(found: Components, share: float) -> BoolArray:
    """Return which groups (M,) do not lie inside another with more weight.

    Args:
        found: the groups.
        share: of a box's area, from which on it lies inside (0 to 1).
    """
    boxes = found.boxes
    ends = boxes[:, :2] + boxes[:, 2:]
    low = np.maximum(boxes[:, None, :2], boxes[None, :, :2])
    high = np.minimum(ends[:, None], ends[None])
    common = np.prod(np.clip(high - low, 0.0, None), axis=2)
    area = np.prod(boxes[:, 2:], axis=1)
    heavier = found.weight[None, :] > found.weight[:, None]
    inside: BoolArray = (common >= share * area[:, None]) & heavier
    return np.asarray(~inside.any(axis=1))


def weights(count: int, marked: Marked) -> FloatArray:
    """Return the sum of the marks (M,) of each group, which is all that `measured` says of it at times."""
    return np.asarray(_weights(count, marked))


# Neighbours in a row are mostly of one group: what is said of such a run is said once, for a number in memory
# that is added to pixel by pixel waits for itself each time.


@numba.njit(cache=True, nogil=True)
def _weights(count: int, marked: Marked) -> Any:
    found = np.zeros(count + 1)
    group, total = 0, np.int64(0)
    for p in range(len(marked.group)):
        if marked.group[p] != group:
            found[group] += total
            group, total = marked.group[p], np.int64(0)
        total += marked.weight[p]
    found[group] += total
    return found[1:]


@numba.njit(cache=True, nogil=True)
def _measure(count: int, marked: Marked, share: float) -> tuple[Any, Any, Any]:
    """Corners (M, 4) left, top, right, bottom, sums and numbers of the marked pixels of each group.

    How many marked pixels each column and row of a group has says where its box begins and ends, with thin
    ends (`share` = 0) and without.
    """
    extents = _extents(count, marked)
    start = np.zeros((count + 1, 2), dtype=np.int64)
    for k in range(count):
        start[k + 1, 0] = start[k, 0] + extents[k, 2] - extents[k, 0]
        start[k + 1, 1] = start[k, 1] + extents[k, 3] - extents[k, 1]
    columns = np.zeros(start[count, 0], dtype=np.int32)
    rows = np.zeros(start[count, 1], dtype=np.int32)
    weight = np.zeros(count)
    pixels = np.zeros(count, dtype=np.int64)
    p, end = 0, len(marked.x)
    while p < end:
        group, row = marked.group[p], marked.y[p]
        own = np.int64(group) - 1
        left = start[own, 0] - extents[own, 0] if own >= 0 else 0
        total, number = np.int64(0), np.int64(0)
        while p < end and marked.group[p] == group and marked.y[p] == row:
            if own >= 0:
                on = np.int32(marked.weight[p] > 0)
                columns[left + marked.x[p]] += on
                number += on
                total += marked.weight[p]
            p += 1
        if own >= 0:
            rows[start[own, 1] + row - extents[own, 1]] += number
            weight[own] += total
            pixels[own] += number
    corners = np.zeros((count, 4), dtype=np.int64)
    for k in range(count):
        if pixels[k]:
            for axis, filled in ((0, columns), (1, rows)):
                first, last = _full_enough(filled[start[k, axis] : start[k + 1, axis]], share)
                corners[k, axis] = extents[k, axis] + first
                corners[k, axis + 2] = extents[k, axis] + last + 1
    return corners, weight, pixels


@numba.njit(cache=True, nogil=True)
def _extents(count: int, marked: Marked) -> Any:
    """Left, top, right, bottom (M, 4) of all pixels of each group (px), those with no weight too; else 0."""
    extents = np.zeros((count, 4), dtype=np.int64)
    p, end = 0, len(marked.x)
    while p < end:
        # What lies together in a row is mostly of one group, and rows ascend.
        group, row, first = marked.group[p], marked.y[p], p
        while p < end and marked.group[p] == group and marked.y[p] == row:
            p += 1
        if group > 0:
            k = group - 1
            if extents[k, 3] == 0:
                extents[k, 0], extents[k, 1] = marked.x[first], row
            extents[k, 0] = min(extents[k, 0], marked.x[first])
            extents[k, 2] = max(extents[k, 2], marked.x[p - 1] + 1)
            extents[k, 3] = row + 1
    return extents


@numba.njit(cache=True, nogil=True)
def _full_enough(filled: npt.NDArray[np.int32], share: float) -> tuple[int, int]:
    """First and last of some columns or rows that hold this share of what the fullest holds, and anything."""
    least = max(share * filled.max(), 1.0)
    first, last = 0, len(filled) - 1
    while filled[first] < least:
        first += 1
    while filled[last] < least:
        last -= 1
    return first, last
