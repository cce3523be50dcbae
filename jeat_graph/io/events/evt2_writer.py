"""Writes EVT 2.0 (see `evt2`)."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from jeat_graph.core import events
from jeat_graph.io.events.raw_header import raw_header
from jeat_graph.io.events.word_writer import Layout, WordWriter


class Evt2Writer(WordWriter):
    """Writes EVT 2.0; gaps of more than 4 h 46 min lose that much."""

    def __init__(self, path: str | Path, size_px: tuple[int, int], origin_us: int = 0) -> None:
        layout = Layout(partial(raw_header, "2.0", origin_us), np.uint32, 1 << 11, events.encode_evt2)
        super().__init__(path, size_px, layout)
