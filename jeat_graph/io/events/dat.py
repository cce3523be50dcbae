"""DAT, Prophesee's older format: a header of lines with `%`, two bytes, then eight bytes an event.

==================  ==========================================================================================
two bytes           kind of event (0 or 12: of pixels; 14: edges of signals), and 8, the bytes of one
bytes 0 to 3        time (µs); it begins again after 71 min
bytes 4 to 7        13..0 column, 27..14 row, 31..28 polarity; in files of version 1 8..0 column, 16..9 row,
                    17 polarity
==================  ==========================================================================================

Source: https://docs.prophesee.ai/stable/data/file_formats/dat.html
"""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

import numpy as np

from jeat_graph.core import events
from jeat_graph.data.errors import DataError
from jeat_graph.io.events.words import WordReader

EVENT_BYTES = 8
PIXELS, PIXELS_12, EDGES = 0, 12, 14


class DatReader(WordReader):
    """Reads DAT.

    Args:
        path: the file.
        file: open, at the two bytes that follow the header.
        size_px: width and height of the picture, if known.
        version: what the header says, 2 if it says nothing.

    Raises:
        DataError: the two bytes announce something else than events of pixels.
    """

    format_name = "DAT"

    def __init__(self, path: Path, file: BinaryIO, size_px: tuple[int, int] | None, version: int = 2) -> None:
        kind = file.read(2)
        if len(kind) == 2 and kind[0] == EDGES:
            raise DataError("holds edges of signals (event type 14), no events of pixels", path)
        if len(kind) < 2:
            raise DataError("ends in its header: the file is cut off", path)
        if kind[0] not in (PIXELS, PIXELS_12) or kind[1] != EVENT_BYTES:
            raise DataError(
                f"is not DAT: its header must be followed by the type of events, 0 or 12, and their size, 8, "
                f"not by {list(kind)}",
                path,
            )
        decode = events.decode_dat_1 if version < 2 else events.decode_dat
        super().__init__(path, file, np.uint64, decode, size_px)
