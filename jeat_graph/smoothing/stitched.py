"""Join the fragments of one vehicle among the tracks of a recording."""

from __future__ import annotations

from collections.abc import Sequence

from jeat_graph.arrays import FloatArray
from jeat_graph.config import Config
from jeat_graph.smoothing.history import TrackHistory


def stitch_histories(
    histories: Sequence[TrackHistory], scan_t: FloatArray, config: Config
) -> tuple[list[TrackHistory], int]:
    return list(histories), 0
