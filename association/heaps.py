"""Which boxes of a scan count where far too many lie on one spot.

A detector that gives each object hundreds of boxes, as a network without non-maximum suppression does, says
no more by them than by some, and what is done with pairs of boxes takes a time that grows with the square of
their number and faster. So a box counts only if fewer than `most_on_one_spot` boxes that count, with a better
score, overlap it by `spot_overlap` or more (intersection over union), and fewer than `most_touching` overlap
it at all. No scan of real traffic comes near either bound. The same in C++ is in core/association/heaps.hpp.
"""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.filters.box_sides import intersection_over_union
from jeat_graph.filters.model_constants import ModelConstants


def kept_boxes(boxes: FloatArray, scores: FloatArray, c: ModelConstants) -> IntArray:
    """Return the places (K,), ascending, of the boxes that count.

    Args:
        boxes: (M, 4) left, top, right, bottom of one scan of one sensor (px).
        scores: (M,) of them; of equal ones the first is the better.
        c: constants.
    """
    kept: list[int] = []
    for k in np.argsort(-scores, kind="stable").tolist():
        overlap = intersection_over_union(boxes[k : k + 1], boxes[kept])[0]
        on_it, touching = (overlap >= c.spot_overlap).sum(), (overlap > 0.0).sum()
        if on_it < c.most_on_one_spot and touching < c.most_touching:
            kept.append(k)
    return np.array(sorted(kept), dtype=np.int64)
