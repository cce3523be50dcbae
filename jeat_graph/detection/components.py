"""Finds boxes around what belongs together: pixels that are marked and lie near one another."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.core import detection as core
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray

#: Whole numbers of 32 bits: half of the memory that has to be read.
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
    corners, weight, pixels = core.measure_groups(count, marked, trim_share)
    found = (pixels > 0) | keep_empty
    corners[pixels == 0] = 0
    kept = corners[found].astype(np.float64)
    boxes = np.column_stack([kept[:, :2], kept[:, 2:] - kept[:, :2]])
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
    return core.group_weights(count, marked)
