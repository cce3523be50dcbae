"""What groups of pixels were a step ago: it tells two vehicles that pass each other from one.

A cloud that covers two clouds of a moment ago, which moved differently, is both of them: its pixels go to the
nearer one. Clouds that lie together where one was a moment ago are pieces of it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray, IntArray

# A box is found again where it overlaps its place by this (intersection over union).
_SAME_IOU = 0.3
# A cloud is a piece of a remembered one if this share of its pixels lies at its place,
_INSIDE = 0.5
# and holds a part of it from this share on.
_TOUCHED = 0.08
# Free space between the pieces of one cloud, as a share of its longer side.
_MOST_GAP = 0.5
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

    def relabel(
        self, labels: npt.NDArray[np.int32], marks: npt.NDArray[Any]
    ) -> tuple[int, npt.NDArray[np.int32]]:
        """Put pieces together, and take clouds apart.

        Args:
            labels: (H, W) cloud of each pixel, from 1; 0 where there is none.
            marks: (H, W) events of each pixel.

        Returns:
            The number of clouds, and the labels (H, W) of the marked pixels anew.
        """
        expected = self.expected()
        y, x = np.nonzero((labels > 0) & (marks > 0))
        cloud = labels[y, x].astype(np.int64)
        out = np.zeros_like(labels)
        if len(expected) and len(y):
            places = np.stack([x, y], axis=1).astype(np.float64) + 0.5
            cloud = self._assign(cloud, places, expected)
        names, number = np.unique(cloud, return_inverse=True)
        out[y, x] = number.reshape(-1) + 1
        return len(names), out

    def _assign(self, cloud: IntArray, places: FloatArray, expected: FloatArray) -> IntArray:
        """Name the cloud of each marked pixel (P,): as before, or a new name for each remembered box.

        Args:
            cloud: (P,) name so far.
            places: (P, 2) middle of each pixel (px).
            expected: (K, 4) where the remembered boxes should be.
        """
        old = self._age >= self._apart_steps
        base = int(cloud.max()) + 1
        share = _shares(cloud, places, expected)
        near = _shares(cloud, places, _grown(expected, self._link_px))
        pieces: dict[int, list[int]] = {}
        new = cloud.copy()
        for m in np.unique(cloud):
            touched = self._apart(np.flatnonzero(old & (share[m] >= _TOUCHED)))
            if len(touched) > 1:
                rows = np.flatnonzero(cloud == m)
                new[rows] = base + touched[_nearest(places[rows], expected[touched])]
                for k in touched.tolist():
                    pieces.setdefault(k, []).insert(0, base + k)
            elif (old & (near[m] >= _INSIDE)).any():
                fit = np.where(old & (near[m] >= _INSIDE), share[m] + near[m], -1.0)
                pieces.setdefault(int(np.argmax(fit)), []).append(int(m))
        for k, names in pieces.items():
            # A dark body fires at its ends only: the gap within it is a part of its length.
            widest = max(2.0 * self._link_px, _MOST_GAP * float(expected[k, 2:].max()))
            _join(new, places, list(dict.fromkeys(names)), widest)
        return new

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


def _join(cloud: IntArray, places: FloatArray, names: list[int], widest_px: float) -> None:
    """Give the first name to all pieces that lie near one that has it already."""
    reach = {name: _extent(places[cloud == name]) for name in names if (cloud == name).any()}
    joined = list(reach)[:1]
    found = True
    while found:
        waiting = [name for name in reach if name not in joined]
        close = [n for n in waiting if any(_gap(reach[n], reach[j]) < widest_px for j in joined)]
        joined += close
        found = bool(close)
    for name in joined[1:]:
        cloud[cloud == name] = joined[0]


def _shares(cloud: IntArray, places: FloatArray, boxes: FloatArray) -> FloatArray:
    """Share of each cloud's pixels that lie in each box (K, 4): rows by the name of the cloud."""
    low, high = boxes[:, :2], boxes[:, :2] + boxes[:, 2:]
    inside = np.asarray(((places[:, None] >= low) & (places[:, None] <= high)).all(axis=2))
    count = np.bincount(cloud)
    sums = [np.bincount(cloud, inside[:, k], minlength=len(count)) for k in range(len(boxes))]
    return np.asarray(np.stack(sums, axis=1) / np.maximum(count, 1)[:, None])


def _nearest(places: FloatArray, boxes: FloatArray) -> IntArray:
    """Return which box each place belongs to: distances in halves of a box, so that 1 is its edge."""
    centre, half = _centres(boxes), np.maximum(boxes[:, 2:] / 2.0, 1.0)
    apart = np.abs(places[:, None] - centre[None]) / half[None]
    return np.asarray(apart.max(axis=2).argmin(axis=1), dtype=np.int64)


def _extent(places: FloatArray) -> FloatArray:
    low = places.min(axis=0) - 0.5
    return np.concatenate([low, places.max(axis=0) + 0.5 - low])


def _iou(a: FloatArray, b: FloatArray) -> FloatArray:
    common = _common(a, b)
    areas = np.prod(a[:, 2:], axis=1)[:, None] + np.prod(b[:, 2:], axis=1)[None]
    return np.asarray(common / np.maximum(areas - common, 1.0))


def _gap(a: FloatArray, b: FloatArray) -> float:
    """Free space between two boxes along rows or columns, whichever is more (px)."""
    low = np.maximum(a[:2], b[:2])
    high = np.minimum(a[:2] + a[2:], b[:2] + b[2:])
    return float((low - high).max())
