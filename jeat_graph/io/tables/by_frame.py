"""Tracks by frame number, for formats that count frames."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from jeat_graph.data.arrays import IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.tables.frame_filling import check_rate
from jeat_graph.data.trajectories import Trajectories


def by_frame(table: Trajectories, path: str | Path, rate_hz: float) -> tuple[IntArray, Trajectories]:
    """Return frames (from 0) and rows, sorted by frame and id, the last row of each pair only.

    Times go to the nearest frame; sampling the table at frame times is the caller's business.

    Raises:
        DataError: the rate is not positive, or a time lies before frame 0.
    """
    frame = np.rint(table.t * check_rate(rate_hz, path)).astype(np.int64)
    if (frame < 0).any():
        raise DataError(f"t = {table.t.min():g} lies before the first frame, which is at 0 s", path)
    order = np.lexsort((np.arange(len(frame)), table.track_id, frame))
    last = np.ones(len(order), dtype=bool)
    last[:-1] = (np.diff(frame[order]) != 0) | (np.diff(table.track_id[order]) != 0)
    rows = order[last]
    return frame[rows], table.take(rows)
