"""Writes DAT (see `dat`)."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from jeat_graph.core import events
from jeat_graph.io.events.dat import EVENT_BYTES, PIXELS_12
from jeat_graph.io.events.raw_header import ORIGIN
from jeat_graph.io.events.word_writer import Layout, WordWriter

_SIDE_BITS = 14


def header(origin_us: int, size_px: tuple[int, int]) -> bytes:
    """Return the header of a file, with the bytes that tell what follows; `origin_us` as in `raw_header`."""
    width, height = size_px
    origin = f"% {ORIGIN} {origin_us}\n" if origin_us else ""
    text = f"% Data file containing CD events.\n% Version 2\n% Height {height}\n% Width {width}\n{origin}"
    return text.encode("ascii") + bytes((PIXELS_12, EVENT_BYTES))


class DatWriter(WordWriter):
    """Writes DAT; gaps of more than 35 min lose time, because its clock begins again after 71 min."""

    def __init__(self, path: str | Path, size_px: tuple[int, int], origin_us: int = 0) -> None:
        layout = Layout(partial(header, origin_us), np.uint64, 1 << _SIDE_BITS, events.encode_dat)
        super().__init__(path, size_px, layout)
