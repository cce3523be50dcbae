"""EVT 2.0, Prophesee's raw format of 32-bit words: an event each, the high bits of the time in words between.

==========================  ======  ==========================================================================
word, bits 31..28           value   bits below
==========================  ======  ==========================================================================
darker, brighter            0, 1    27..22 low bits of the time (µs), 21..11 column, 10..0 row
time                        8       27..0 bits 33..6 of the time; it begins again after 4 h 46 min
edge of a signal            10      27..22 low bits of the time, 12..8 channel, 0 value
others, continued           14, 15  what the camera says about itself; passed over
==========================  ======  ==========================================================================

Source: https://docs.prophesee.ai/stable/data/encoding_formats/evt2.html
"""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

import numpy as np

from jeat_graph.core import events
from jeat_graph.io.events.words import WordReader


class Evt2Reader(WordReader):
    """Reads EVT 2.0."""

    format_name = "EVT2"

    def __init__(self, path: Path, file: BinaryIO, size_px: tuple[int, int] | None) -> None:
        super().__init__(path, file, np.uint32, events.decode_evt2, size_px)
