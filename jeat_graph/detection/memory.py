"""Compares groups of pixels with those of the step before, so that vehicles that pass each other stay two.

A cloud that covers two clouds of a moment ago, which moved differently, is both of them: its pixels go to the
nearer one. Clouds that lie together where one was a moment ago are pieces of it.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.detection.components import Marked, Whole

# A box is found again where it overlaps its place by this (intersection over union).
_SAME_IOU = 0.3
# A cloud is a piece of a remembered one if this share of its pixels lies at its place,
_INSIDE = 0.5
# and holds a part of it from this share on.
_TOUCHED = 0.08
# Share of a new velocity in its running mean.
_NEW_SHARE = 0.3


class CloudMemory:
    """Boxes of the last step, where they went, and for how long they have been there.

    Args:
        link_px: gap that a cloud may have (px): pieces farther than twice that from each other stay apart,
            and clouds that do not move apart by it within `apart_steps` are not told apart.
        apart_steps: steps that a cloud must have been there to be remembered as one of two, and over which
            two must move differently.

    Attributes:
        boxes: (K, 4) of the last step.
        velocity: (K, 2) of their centres (px a step); 0 where a box is new.
    """

    def __init__(self, link_px: int, apart_steps: int) -> None:
        self._link_px = float(link_px)
        self._apart_steps = apart_steps
        self.boxes: FloatArray = np.zeros((0, 4))
        self.velocity: FloatArray = np.zeros((0, 2))
        self._age: IntArray = np.zeros(0, dtype=np.int64)

    def expected(self) -> FloatArray:
        """Return where the boxes (K, 4) should be now (px)."""
        moved = self.boxes.copy()
        moved[:, :2] += self.velocity
        return moved

    def relabel(self, marked: Marked) -> tuple[int, Marked]:
        """Put pieces together, and take clouds apart.

        Args:
            marked: pixels, each of a cloud.

        Returns:
            The number of clouds, and the pixels with the clouds numbered anew.
        """
        expected = self.expected()
        cloud = marked.group
        if len(expected) and len(cloud):
            cloud = self._assign(marked, expected)
        there = np.bincount(cloud) > 0
        return int(there.sum()), marked._replace(group=np.cumsum(there, dtype=np.int32)[cloud])

    def _assign(self, marked: Marked, expected: FloatArray) -> Whole:
        """Name the cloud of each marked pixel (P,): as before, or a new name for each remembered box.

        Args:
            marked: pixels; their clouds have the names so far.
            expected: (K, 4) where the remembered boxes should be.
        """
        old = self._age >= self._apart_steps
        cloud = marked.group
        base = int(cloud.max()) + 1
        both = np.concatenate([expected, _grown(expected, self._link_px)])
        share, near = np.split(_shares(marked, both, base), 2, axis=1)
        touch = old & (share >= _TOUCHED)
        pieces: dict[int, list[int]] = {}
        new = cloud.copy()
        divided = np.zeros(base, dtype=bool)
        for m in np.flatnonzero(touch.sum(axis=1) > 1).tolist():
            touched = self._apart(np.flatnonzero(touch[m]))
            if len(touched) > 1:
                rows = np.flatnonzero(cloud == m)
                places = np.column_stack([marked.x[rows], marked.y[rows]]).astype(np.float64) + 0.5
                new[rows] = base + touched[_nearest(places, expected[touched])]
                divided[m] = True
                for k in touched.tolist():
                    pieces.setdefault(k, []).insert(0, base + k)
        fit = np.where(old & (near >= _INSIDE), share + near, -1.0)
        for m in np.flatnonzero(~divided & (fit.max(axis=1) > 0.0)).tolist():
            pieces.setdefault(int(fit[m].argmax()), []).append(m)
        extents, sizes = _extents(marked._replace(group=new), base + len(expected))
        table = np.arange(base + len(expected))
        for k, names in pieces.items():
            # A dark body fires at its ends only: pieces may be far apart, but within what it was.
            most_px = expected[k, 2:] + 2.0 * self._link_px
            _join(table, list(dict.fromkeys(names)), extents, sizes, most_px)
        return np.asarray(table[new], dtype=np.int32)

    def remember(self, boxes: FloatArray) -> None:
        """Keep the boxes (M, 4) of this step for the next."""
        expected = self.expected()
        velocity = np.zeros((len(boxes), 2))
        age = np.zeros(len(boxes), dtype=np.int64)
        if len(boxes) and len(expected):
            overlap = _iou(boxes, expected)
            best = overlap.argmax(axis=1)
            again = (overlap.max(axis=1) >= _SAME_IOU) & (
                overlap.argmax(axis=0)[best] == np.arange(len(boxes))
            )
            before = best[again]
            moved = _centres(boxes[again]) - _centres(self.boxes[before])
            share = np.where(self._age[before] == 0, 1.0, _NEW_SHARE)[:, None]
            velocity[again] = share * moved + (1.0 - share) * self.velocity[before]
            age[again] = self._age[before] + 1
        self.boxes, self.velocity, self._age = boxes.copy(), velocity, age

    def _apart(self, which: IntArray) -> IntArray:
        """Keep those of some remembered boxes that move differently from the first of them, and it."""
        if len(which) < 2:
            return which
        velocity = self.velocity[which]
        apart = np.abs(velocity[:, None] - velocity[None]).max(axis=2) * self._apart_steps > self._link_px
        first = int(apart.sum(axis=1).argmax())
        return np.asarray(which[apart[first] | (np.arange(len(which)) == first)])


def _centres(boxes: FloatArray) -> FloatArray:
    return boxes[:, :2] + boxes[:, 2:] / 2.0


def _grown(boxes: FloatArray, by: float) -> FloatArray:
    return np.column_stack([boxes[:, :2] - by, boxes[:, 2:] + 2.0 * by])


def _common(a: FloatArray, b: FloatArray) -> FloatArray:
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum((a[:, :2] + a[:, 2:])[:, None], (b[:, :2] + b[:, 2:])[None])
    return np.asarray(np.prod(np.clip(high - low, 0.0, None), axis=2))


def _join(
    table: IntArray, names: list[int], extents: FloatArray, sizes: IntArray, most_px: FloatArray
) -> None:
    """Give the first name to the pieces, largest first, as long as all of them together are not too large.

    Args:
        table: new name of each name; changed.
        names: of the pieces; the first comes first whatever its size.
        extents: (names, 4) left, top, right, bottom of each (px).
        sizes: (names,) pixels of each.
        most_px: (2,) width and height that they may have together (px).
    """
    names = [name for name in names if sizes[name]]
    whole = None
    for name in sorted(names, key=lambda name: (name != names[0], -sizes[name])):
        part = extents[name]
        if whole is None:
            whole = part
            continue
        both = np.concatenate([np.minimum(whole[:2], part[:2]), np.maximum(whole[2:], part[2:])])
        if (both[2:] - both[:2] <= most_px).all():
            table[name] = names[0]
            whole = both


@numba.njit(cache=True, nogil=True)
def _extents(marked: Marked, names: int) -> tuple[Any, Any]:
    """Left, top, right, bottom (names, 4) of the pixels of each cloud (px), and their number (names,)."""
    extents = np.empty((names, 4))
    extents[:, :2] = np.inf
    extents[:, 2:] = -np.inf
    sizes = np.zeros(names, dtype=np.int64)
    p, end = 0, len(marked.x)
    while p < end:
        # What lies together in a row is mostly of one cloud.
        name, row, first = marked.group[p], marked.y[p], p
        while p < end and marked.group[p] == name and marked.y[p] == row:
            p += 1
        sizes[name] += p - first
        extents[name, 0] = min(extents[name, 0], marked.x[first])
        extents[name, 1] = min(extents[name, 1], row)
        extents[name, 2] = max(extents[name, 2], marked.x[p - 1] + 1)
        extents[name, 3] = max(extents[name, 3], row + 1)
    return extents, sizes


def _shares(marked: Marked, boxes: FloatArray, names: int) -> FloatArray:
    """Share of each cloud's pixels whose middles lie in each box (K, 4): rows by the name of the cloud."""
    inside, count = _count_inside(marked, boxes, names)
    return np.asarray(inside / np.maximum(count, 1)[:, None])


@numba.njit(cache=True, nogil=True)
def _count_inside(marked: Marked, boxes: FloatArray, names: int) -> tuple[Any, Any]:
    """Pixels of each cloud in each box (names, K), and of each cloud (names,); pixels come row by row."""
    x, y, cloud = marked.x, marked.y, marked.group
    inside = np.zeros((names, len(boxes)), dtype=np.int64)
    count = np.zeros(names, dtype=np.int64)
    # Where each row begins: a box asks but few pixels of its own rows.
    start = np.zeros(y[len(y) - 1] + 2, dtype=np.int64)
    for p in range(len(cloud)):
        count[cloud[p]] += 1
        start[y[p] + 1] = p + 1
    for row in range(1, len(start)):
        start[row] = max(start[row], start[row - 1])
    for j in range(len(boxes)):
        left, top, width, height = boxes[j]
        row = max(int(np.floor(top - 0.5)), 0)
        while row < len(start) - 1 and row + 0.5 - top <= height:
            if row + 0.5 >= top:
                k, end = start[row], start[row + 1]
                k += np.searchsorted(x[k:end], left - 1.0)
                while k < end and x[k] + 0.5 - left <= width:
                    if x[k] + 0.5 - left >= 0.0:
                        inside[cloud[k], j] += 1
                    k += 1
            row += 1
    return inside, count


@numba.njit(cache=True, nogil=True)
def _nearest(places: FloatArray, boxes: FloatArray) -> Any:
    """Return which box each place belongs to: distances in halves of a box, so that 1 is its edge."""
    out = np.zeros(len(places), dtype=np.int64)
    for k in range(len(places)):
        least = np.inf
        for j in range(len(boxes)):
            half_x, half_y = max(boxes[j, 2] / 2.0, 1.0), max(boxes[j, 3] / 2.0, 1.0)
            dx = abs(places[k, 0] - boxes[j, 0] - boxes[j, 2] / 2.0) / half_x
            dy = abs(places[k, 1] - boxes[j, 1] - boxes[j, 3] / 2.0) / half_y
            if max(dx, dy) < least:
                least = max(dx, dy)
                out[k] = j
    return out


def _iou(a: FloatArray, b: FloatArray) -> FloatArray:
    common = _common(a, b)
    areas = np.prod(a[:, 2:], axis=1)[:, None] + np.prod(b[:, 2:], axis=1)[None]
    return np.asarray(common / np.maximum(areas - common, 1.0))
