"""Small sets as `simulate` writes them: rectangles of 64 x 48 px, and single segments of any size."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from jeat_graph.data.events import EventArray
from jeat_graph.io.events.dsec_writer import EventWriter
from jeat_graph.io.exports.prophesee_writer import write_array
from jeat_graph_sehn.simulation.dataset.protocol import Protocol
from jeat_graph_sehn.simulation.dataset.recording import record_dataset
from jeat_graph_sehn.simulation.layouts.sets import SetSegment


@pytest.fixture(scope="module")
def rectangle_set(tmp_path_factory) -> Path:
    """Three segments of four frames with three vehicles, one segment a split."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "dataset"))
    try:
        from moving_rectangles import MovingRectangles
    finally:
        sys.path.pop(0)
    out = tmp_path_factory.mktemp("sets") / "set"
    protocol = Protocol(3, video="png", shares=(1.0, 1.0, 1.0))
    record_dataset(partial(MovingRectangles, frames=4, vehicles=3), out, protocol, workers=1)
    return out


@pytest.fixture
def one_segment(tmp_path):
    """Make a segment of a size with boxes at times (µs), all of one kind, and events at random."""

    def make(size_px: tuple[int, int], times_us: list[int], kind: int = 0, boxes=None) -> SetSegment:
        folder = tmp_path / "segments" / "000000"
        rng = np.random.default_rng(7)
        n = 400
        t = np.sort(rng.integers(0, max(times_us) + 1, n))
        x, y = (rng.integers(0, side, n).astype(np.uint16) for side in size_px)
        events = EventArray(t, x, y, rng.integers(0, 2, n).astype(np.uint8))
        folder.mkdir(parents=True)
        with EventWriter(folder / "events.h5", size_px) as writer:
            writer.append(events, max(times_us))
        k = len(times_us)
        rows = np.tile([10.0, 12.0, 30.0, 20.0], (k, 1)) if boxes is None else np.asarray(boxes, dtype=float)
        write_array(folder / "boxes.npy", np.array(times_us), rows, np.full(k, kind), np.arange(1, k + 1))
        return SetSegment("000000", "train", folder)

    return make
