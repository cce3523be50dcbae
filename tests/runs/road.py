"""A road of four lanes across the picture, and truth of rows that are drawn on it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jeat_graph import GroundTruth
from jeat_graph.data.arrays import FloatArray

IMAGE = (1280, 720)
#: Top (px) and speed (px/s) of each lane: vehicles drive two to four times their size in a second.
LANES = ((150.0, 260.0), (270.0, 320.0), (390.0, -240.0), (510.0, -300.0))


def truth_of(rows: Sequence[Sequence[float]], frames: FloatArray) -> GroundTruth:
    """Truth of rows of t, number, left, top, width, height; nothing is left out."""
    g = np.array(rows)
    return GroundTruth(
        t=g[:, 0],
        object_id=g[:, 1].astype(np.int64),
        boxes=np.ascontiguousarray(g[:, 2:]),
        motion=None,
        ignore=np.zeros(len(g), dtype=bool),
        frames=frames,
    )
