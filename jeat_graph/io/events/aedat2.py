"""AEDAT 2.0, the format of jAER: a header of lines with `#`, then big-endian words of address and time (µs).

==========  ==================================================================================================
DAVIS       31 set: a sample of a frame or of the inertial sensors, passed over; 30..22 row, 21..12 column,
            11 polarity, 10 set: an edge of a signal
DVS128      15 set: an edge of a signal; 14..8 row, 7..1 column, 0 polarity
==========  ==================================================================================================

Rows count from the bottom and columns from the right; here they count from the top left, as in pictures.
The polarity bit of a DAVIS is 1 where it became brighter, that of a DVS128 where it became darker.
Times of 32 bits begin again after 71 min. The header names the camera (`AEChip`), if jAER wrote it.
Source: https://docs.inivation.com/software/software-advanced-usage/file-formats/aedat-2.0.html
"""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

import numpy as np

from jeat_graph.core import events
from jeat_graph.data.errors import DataError
from jeat_graph.io.events.reader import agreed_size
from jeat_graph.io.events.words import WordReader

#: Pictures of the cameras by what their names hold, in lower case.
CAMERAS = {
    "davis240": (240, 180),
    "davis346": (346, 260),
    "davis640": (640, 480),
    "dvs128": (128, 128),
    "tmpdiff128": (128, 128),
}
_DVS128 = (128, 128)
_END = b"# End Of ASCII Header"
_MOST_HEADER_LINES = 10_000
_MOST_LINE_BYTES = 1 << 16


class Aedat2Reader(WordReader):
    """Reads AEDAT 2.0.

    Args:
        path: the file.
        file: open, at its beginning.
        size_px: width and height of the picture, if the user says.

    Raises:
        DataError: neither the header nor the user tells the camera, so that addresses cannot be read.
    """

    format_name = "AEDAT2"

    def __init__(self, path: Path, file: BinaryIO, size_px: tuple[int, int] | None) -> None:
        header = _header(file)
        named = next((size for name, size in CAMERAS.items() if name in header), None)
        size = agreed_size(size_px, named, path)
        if size is None:
            raise DataError(
                "does not say which camera recorded it, so its addresses cannot be read; give the size of "
                f"its picture, one of {', '.join(f'{w}x{h}' for w, h in sorted(set(CAMERAS.values())))}",
                path,
            )
        dvs128 = (named or size) == _DVS128
        decode = events.decode_aedat2_dvs128 if dvs128 else events.decode_aedat2_davis
        super().__init__(path, file, np.uint64, decode, size)


def _header(file: BinaryIO) -> str:
    """Read the lines of the header, in lower case; the file then stands at the first word."""
    lines: list[bytes] = []
    while len(lines) < _MOST_HEADER_LINES:
        at = file.tell()
        line = file.readline(_MOST_LINE_BYTES)
        if not line.startswith(b"#") or not line.endswith(b"\n"):
            file.seek(at)
            break
        lines.append(line)
        if line.startswith(_END):
            break
    return b"".join(lines).decode("latin-1").lower()
