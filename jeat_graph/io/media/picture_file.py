"""Reads one picture from a file: a regular file, of a size that a camera has."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import numpy.typing as npt

from jeat_graph.data.errors import DataError
from jeat_graph.io.files.limits import check_file

#: More pixels than any camera has; so many of one colour would stand in a file of 100 kB, and fill 400 MB.
MOST_PIXELS = 1 << 27
_PNG = b"\x89PNG\r\n\x1a\n"
_PNG_SIZE = struct.Struct(">16x2I")
_BMP = b"BM"
_BMP_SIZE = struct.Struct("<18x2i")  # a height below 0: from the top down
_BMP_SHORT, _BMP_SHORT_SIZE = b"\x0c\0\0\0", struct.Struct("<18x2H")  # the head of OS/2
_JPEG = b"\xff\xd8"
_JPEG_SIZE = struct.Struct(">2H")
_JPEG_SIZE_AT = 5  # in a frame's head, from its marker on
_JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_JPEG_BARE = frozenset((0x01, *range(0xD0, 0xD9)))  # markers without a length


def read_picture(path: str | Path) -> npt.NDArray[np.uint8]:
    """Return a picture (H, W, 3): blue, green, red.

    Raises:
        DataError: no such file, a folder, pipe or device, no picture, or one of too many pixels.
    """
    import cv2

    check_file(path)
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise DataError(f"cannot be read: {error.strerror or error}", path) from None
    width, height = _size(content)
    if width * height > MOST_PIXELS:
        raise DataError(f"claims {width} x {height} px: more than a camera has", path)
    try:
        picture = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR) if content else None
    except cv2.error:
        picture = None
    if picture is None:
        raise DataError("is not a picture that can be read", path)
    return np.asarray(picture, dtype=np.uint8)


def _size(content: bytes) -> tuple[int, int]:
    """Return width and height (px) of a PNG, BMP or JPEG; 0, 0 where its head does not say."""
    if content.startswith(_PNG) and len(content) >= _PNG_SIZE.size:
        width, height = _PNG_SIZE.unpack_from(content)
        return width, height
    if content.startswith(_BMP) and len(content) >= _BMP_SIZE.size:
        short = content[14:18] == _BMP_SHORT
        width, height = (_BMP_SHORT_SIZE if short else _BMP_SIZE).unpack_from(content)
        return abs(width), abs(height)
    at = len(_JPEG)
    end = len(content) - _JPEG_SIZE_AT - _JPEG_SIZE.size
    while content.startswith(_JPEG) and at <= end and content[at] == 0xFF:
        marker = content[at + 1]
        if marker in _JPEG_FRAMES:
            height, width = _JPEG_SIZE.unpack_from(content, at + _JPEG_SIZE_AT)
            return width, height
        if marker == 0xFF:  # padding
            at += 1
        else:
            at += 2 if marker in _JPEG_BARE else 2 + int.from_bytes(content[at + 2 : at + 4], "big")
    return 0, 0
