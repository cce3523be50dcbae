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

    def renumbered(self, number: IntArray) -> Marked:
        """Return the pixels of groups g with `number[g]` > 0, which is their new number."""
        return Marked(*_renumbered(self, number))


def linked(marks: npt.NDArray[Any], link_px: int) -> tuple[int, Marked]:
    """Number the groups of marked pixels: two belong together across a gap of less than `link_px`.

    Args:
        marks: (H, W), marked where positive.
        link_px: the gap (px), along rows and columns.

    Returns:
        The number of groups, and the marked pixels.
    """
    import cv2

    marked = np.asarray(marks > 0)
    mask: Any = marked.view(np.uint8)
    if link_px > 1:
        mask = cv2.dilate(mask, np.ones((link_px, link_px), dtype=np.uint8))
    count, labels = cv2.connectedComponents(mask, connectivity=8, ltype=cv2.CV_32S)
    return count - 1, Marked(*_gathered(np.flatnonzero(marked), labels, marks))


def measured(count: int, marked: Marked, trim_share: float = 0.0, *, keep_empty: bool = False) -> Components:
    """Measure groups by their marked pixels.

    Args:
        count: number of groups.
        marked: pixels; those with no weight are not marked.
        trim_share: columns at the left and right of a group that have fewer marked pixels than this share of
            its fullest column are not of its box, and so for rows: thin shadows, and noise.
        keep_empty: also return groups without a marked pixel, with boxes of no size, so that rows are groups.
    """
    corners, weight, pixels = _measure(count, marked)
    if trim_share > 0.0:
        _trim(marked, corners, trim_share)
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
def _renumbered(marked: Marked, number: IntArray) -> tuple[Any, Any, Any, Any]:
    """Column, row, new group and mark of the pixels whose group has a new number above 0."""
    found = np.empty((4, len(marked.group)), dtype=np.int32)
    k = 0
    for p in range(len(marked.group)):
        new = number[marked.group[p]]
        if new > 0:
            found[0, k], found[1, k] = marked.x[p], marked.y[p]
            found[2, k], found[3, k] = new, marked.weight[p]
            k += 1
    return found[0, :k], found[1, :k], found[2, :k], found[3, :k]


@numba.njit(cache=True, nogil=True)
def _gathered(places: IntArray, labels: Any, marks: Any) -> tuple[Any, Any, Any, Any]:
    """Column, row, group and mark (P,) of pixels by their number, row by row."""
    width = marks.shape[1]
    found = np.empty((4, len(places)), dtype=np.int32)
    row, begin = 0, 0
    for k in range(len(places)):
        while places[k] >= begin + width:
            row, begin = row + 1, begin + width
        column = places[k] - begin
        found[0, k], found[1, k] = column, row
        found[2, k], found[3, k] = labels[row, column], marks[row, column]
    return found[0], found[1], found[2], found[3]


@numba.njit(cache=True, nogil=True)
def _measure(count: int, marked: Marked) -> tuple[Any, Any, Any]:
    """Corners (M, 4) left, top, right, bottom, sums and numbers of the marked pixels of each group."""
    corners = np.empty((count, 4), dtype=np.int64)
    corners[:, :2] = np.iinfo(np.int64).max
    corners[:, 2:] = 0
    weight = np.zeros(count)
    pixels = np.zeros(count, dtype=np.int64)
    p, end = 0, len(marked.x)
    while p < end:
        k, row = marked.group[p] - 1, marked.y[p]
        first, last, total, number = -1, -1, np.int64(0), 0
        while p < end and marked.group[p] - 1 == k and marked.y[p] == row:
            if marked.weight[p] > 0:
                if first < 0:
                    first = marked.x[p]
                last = marked.x[p]
                total += marked.weight[p]
                number += 1
            p += 1
        if number and k >= 0:
            corners[k, 0] = min(corners[k, 0], first)
            corners[k, 1] = min(corners[k, 1], row)
            corners[k, 2] = max(corners[k, 2], last + 1)
            corners[k, 3] = max(corners[k, 3], row + 1)
            weight[k] += total
            pixels[k] += number
    return corners, weight, pixels


@numba.njit(cache=True, nogil=True)
def _trim(marked: Marked, corners: Any, share: float) -> None:
    """Take thin ends off the corners (M, 4), from each side up to the first full enough column or row."""
    count = len(corners)
    start = np.zeros((count + 1, 2), dtype=np.int64)
    for k in range(count):
        start[k + 1, 0] = start[k, 0] + max(corners[k, 2] - corners[k, 0], 0)
        start[k + 1, 1] = start[k, 1] + max(corners[k, 3] - corners[k, 1], 0)
    columns = np.zeros(start[count, 0], dtype=np.int64)
    rows = np.zeros(start[count, 1], dtype=np.int64)
    p, end = 0, len(marked.x)
    while p < end:
        k, row = marked.group[p] - 1, marked.y[p]
        left = start[k, 0] - corners[k, 0] if k >= 0 else 0
        number = 0
        while p < end and marked.group[p] - 1 == k and marked.y[p] == row:
            if marked.weight[p] > 0 and k >= 0:
                columns[left + marked.x[p]] += 1
                number += 1
            p += 1
        if number:
            rows[start[k, 1] + row - corners[k, 1]] += number
    for k in range(count):
        for axis, filled in ((0, columns), (1, rows)):
            low, high = start[k, axis], start[k + 1, axis]
            if high <= low:
                continue
            least = share * filled[low:high].max()
            first, last = low, high - 1
            while filled[first] < least:
                first += 1
            while filled[last] < least:
                last -= 1
            corners[k, axis + 2] = corners[k, axis] + last - low + 1
            corners[k, axis] += first - low
