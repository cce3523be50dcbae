"""Compares groups of pixels with those of the step before, so that vehicles that pass each other stay two.

A cloud that covers two clouds of a moment ago, which moved differently, is both of them: its pixels go to
the nearer one. Clouds that lie together where one was a moment ago are pieces of it; where they stay apart,
it was never one thing.
"""

from __future__ import annotations

import numpy as np

from jeat_graph.core import detection as core
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
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
            and clouds that do not move apart by it within `apart_steps` are not distinguished.
        apart_steps: steps that a cloud must have been there to be remembered as one of two, and over which
            two must move differently.
        piece_steps: steps for which the pieces of a cloud are put together after it was last whole.

    Attributes:
        boxes: (K, 4) of the last step.
        velocity: (K, 2) of their centres (px a step); 0 where a box is new.
    """

    def __init__(self, link_px: int, apart_steps: int, piece_steps: int) -> None:
        self._link_px = float(link_px)
        self._apart_steps, self._piece_steps = apart_steps, piece_steps
        self.boxes: FloatArray = np.zeros((0, 4))
        self.velocity: FloatArray = np.zeros((0, 2))
        self._age: IntArray = np.zeros(0, dtype=np.int64)
        # Steps since a box was of one whole cloud; and the same with the step that is on, if it is.
        self._broken: IntArray = np.zeros(0, dtype=np.int64)
        self._broken_now = self._broken

    def expected(self) -> FloatArray:
        """Return where the boxes (K, 4) should be now (px)."""
        moved = self.boxes.copy()
        moved[:, :2] += self.velocity
        return moved

    def relabel(self, count: int, marked: Marked) -> tuple[int, Marked]:
        """Put pieces together, and take clouds apart.

        Args:
            count: number of clouds.
            marked: pixels, each of a cloud.

        Returns:
            The number of clouds, and the pixels with the clouds renumbered.
        """
        self._broken_now = np.zeros_like(self._broken)
        old = np.flatnonzero(self._age >= self._apart_steps)
        if not len(old) or not len(marked.group):
            return count, marked
        expected = self.expected()[old]
        base = count + 1
        share, near = _shares(marked, expected, self._link_px, base)
        new, pieces = self._pieces(marked, share, near, old, expected)
        if all(len(names) < 2 for names in pieces) and new is marked.group:
            return count, marked  # as they were
        extents, sizes = core.cloud_extents(marked._replace(group=new), base + len(old))
        table = np.arange(base + len(old))
        for k, names in enumerate(pieces):
            names = [name for name in dict.fromkeys(names) if sizes[name]]
            if len(names) > 1:
                self._broken_now[old[k]] = self._broken[old[k]] + 1
                if self._broken_now[old[k]] > self._piece_steps:
                    continue
            # A dark body fires at its ends only: pieces may be far apart, but within what it was.
            most_px = expected[k, 2:] + 2.0 * self._link_px
            _join(table, names, extents, sizes, most_px)
        there = np.zeros(len(table), dtype=bool)
        there[table[sizes > 0]] = True
        number = np.cumsum(there, dtype=np.int32)
        return int(there.sum()), marked._replace(group=number[table][new])

    def _pieces(
        self, marked: Marked, share: FloatArray, near: FloatArray, old: IntArray, expected: FloatArray
    ) -> tuple[Whole, list[list[int]]]:
        """Find the pieces of remembered boxes, and divide clouds that are several of them.

        Args:
            marked: pixels; their M clouds have the names so far.
            share: (M + 1, K) of each cloud's pixels that lie in the box.
            near: (M + 1, K) that lie in it or no farther from it than the gap.
            old: (K,) rows of the boxes.
            expected: (K, 4) where they should be.

        Returns:
            The cloud of each pixel (P,), with the new name M + 1 + k where it is a part of box k; and the
            names of the pieces of each box, that of its part first.
        """
        cloud = marked.group
        base = len(share)
        new = cloud
        touch = share >= _TOUCHED
        divided = np.zeros(base, dtype=bool)
        pieces: list[list[int]] = [[] for _ in old]
        for m in np.flatnonzero(touch.sum(axis=1) > 1).tolist():
            which = np.flatnonzero(touch[m])
            touched = which[self._apart(old[which])]
            if len(touched) > 1:
                new = cloud.copy() if new is cloud else new
                rows = np.flatnonzero(cloud == m)
                places = np.column_stack([marked.x[rows], marked.y[rows]]).astype(np.float64) + 0.5
                new[rows] = base + touched[core.nearest_boxes(places, expected[touched])]
                divided[m] = True
                for k in touched.tolist():
                    pieces[k].insert(0, base + k)
        fit = np.where(near >= _INSIDE, share + near, -1.0)
        fit[divided] = -1.0
        best = fit.argmax(axis=1)
        for m in np.flatnonzero(fit.max(axis=1) > 0.0).tolist():
            pieces[best[m]].append(m)
        return new, pieces

    def remember(self, boxes: FloatArray) -> None:
        """Keep the boxes (M, 4) of this step for the next."""
        expected = self.expected()
        velocity = np.zeros((len(boxes), 2))
        age, broken = np.zeros(len(boxes), dtype=np.int64), np.zeros(len(boxes), dtype=np.int64)
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
            broken[again] = self._broken_now[before]
        self.boxes, self.velocity, self._age, self._broken = boxes.copy(), velocity, age, broken
        self._broken_now = np.zeros_like(broken)

    def _apart(self, which: IntArray) -> BoolArray:
        """Return which of some remembered boxes move differently from the first of them, and it."""
        velocity = self.velocity[which]
        apart = np.abs(velocity[:, None] - velocity[None]).max(axis=2) * self._apart_steps > self._link_px
        first = int(apart.sum(axis=1).argmax())
        return np.asarray(apart[first] | (np.arange(len(which)) == first))


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


def _shares(marked: Marked, boxes: FloatArray, by: float, names: int) -> tuple[FloatArray, FloatArray]:
    """Share of each cloud's pixels with middles in each box (names, K), and in it grown `by` to all sides."""
    inside, near, count = core.count_inside(marked, boxes, _grown(boxes, by), names)
    most = np.maximum(count, 1)[:, None]
    return inside / most, near / most


def _iou(a: FloatArray, b: FloatArray) -> FloatArray:
    common = _common(a, b)
    areas = np.prod(a[:, 2:], axis=1)[:, None] + np.prod(b[:, 2:], axis=1)[None]
    return np.asarray(common / np.maximum(areas - common, 1.0))
