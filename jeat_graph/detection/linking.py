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

import numpy as np
import numpy.typing as npt

from jeat_graph.core import detection as core
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
    if marks.dtype not in (np.uint8, np.uint16):
        marks = marks.astype(np.int32)
    return MarkedPixels(bits, *core.collect_marked(bits, np.ascontiguousarray(marks)))


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
    count, x, y, group, weight = core.link_marked(
        pixels.bits, pixels.x, pixels.weight, pixels.start, link_px, least_weight
    )
    return count, Marked(x, y, group, weight)
