"""EVT 3.0, Prophesee's raw format of 16-bit words: row, time and polarity are said only when they change.

==========================  ======  ==========================================================================
word, bits 15..12           value   bits below
==========================  ======  ==========================================================================
row                         0       10..0 row of the events that follow
event                       2       11 polarity, 10..0 column
first column of a group     3       11 polarity, 10..0 column
group of 12, of 8           4, 5    one bit for each column from the first, which moves on by 12 or 8
time, low and high          6, 8    11..0 bits 11..0, and 23..12, of the time (µs): 16.8 s in all
edge of a signal            10      11..8 channel, 0 value
others, continued           14, 7,  what the camera says about itself; passed over
                            15
==========================  ======  ==========================================================================

Source: https://docs.prophesee.ai/stable/data/encoding_formats/evt3.html
"""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

import numpy as np

from jeat_graph.core import events
from jeat_graph.io.events.words import WordReader


class Evt3Reader(WordReader):
    """Reads EVT 3.0."""

    format_name = "EVT3"

    def __init__(self, path: Path, file: BinaryIO, size_px: tuple[int, int] | None) -> None:
        super().__init__(path, file, np.uint16, events.decode_evt3, size_px)
