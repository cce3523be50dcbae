"""Boxes as RVT's code takes them: its classes, within the picture, none too small.

RVT knows the two data sets of Prophesee, by the size of their pictures. 1280 x 720: pedestrian 0, two-wheeler
1, car 2, and its reader passes over all others. 304 x 240: car 0, pedestrian 1. Vans, lorries and buses are
cars here, since a detector that is shown them without a label learns to pass over them.
Source: https://github.com/uzh-rpg/RVT (MIT), `scripts/genx`, for what is kept of the boxes.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from jeat_graph.io.exports.prophesee_writer import BOX_DTYPE
from jeat_graph_sehn.simulation.layouts.sets import two_wheels

LARGE, SMALL = (1280, 720), (304, 240)  # px, of Prophesee's 1 Mpx and Gen1 automotive data sets
_LEAST_SIDE_PX = 5.0
_TWO_WHEELER, _CAR_OF_LARGE, _CAR_OF_SMALL = 1, 2, 0


def rvt_classes(boxes: npt.NDArray[np.void], size_px: tuple[int, int]) -> npt.NDArray[np.void]:
    """Return the boxes (K,) with RVT's numbers of classes; what it has none for is left out."""
    riders = two_wheels(boxes["class_id"])
    if size_px == SMALL:
        kept = boxes[~riders].copy()
        kept["class_id"] = _CAR_OF_SMALL
        return kept
    kept = boxes.copy()
    kept["class_id"] = np.where(riders, _TWO_WHEELER, _CAR_OF_LARGE)
    return kept


def rvt_boxes(boxes: npt.NDArray[np.void], size_px: tuple[int, int]) -> npt.NDArray[np.void]:
    """Return the boxes (K,) that RVT's preprocessing keeps, cut to the pixels' centres 0 to W - 1."""
    out = rvt_classes(boxes, size_px)
    for start, side, end in (("x", "w", size_px[0] - 1), ("y", "h", size_px[1] - 1)):
        low = np.clip(out[start], 0, end)
        out[side] = np.clip(out[start] + out[side], 0, end) - low
        out[start] = low
    large = (out["w"] >= _LEAST_SIDE_PX) & (out["h"] >= _LEAST_SIDE_PX)
    kept: npt.NDArray[np.void] = np.zeros(int(large.sum()), dtype=BOX_DTYPE)
    kept[:] = out[large]
    return kept
