"""Writes EVT 3.0 (see `evt3`): runs of events of one row, time and polarity become groups of columns."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from jeat_graph.core import events
from jeat_graph.io.events.raw_header import raw_header
from jeat_graph.io.events.word_writer import Layout, WordWriter


class Evt3Writer(WordWriter):
    """Writes EVT 3.0."""

    def __init__(self, path: str | Path, size_px: tuple[int, int], origin_us: int = 0) -> None:
        layout = Layout(partial(raw_header, "3.0", origin_us), np.uint16, 1 << 11, events.encode_evt3)
        super().__init__(path, size_px, layout)
