"""Frame numbers: from which they count, and which frame a picture's name says.

One rule for all files that do not fix it themselves (KITTI counts from 0): frames count from 0 where there is
a frame 0, else from 1. Frame k is at (k - first) / rate.
"""

from __future__ import annotations

import re

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError

#: What a recording's first frame may be.
FIRST_FRAMES = (0, 1)
_NUMBER = re.compile(r"\d+(?!.*\d)", re.DOTALL)
# More digits than these are no frame number, and no whole number that all readers can hold.
_MOST_DIGITS = 15


def first_frame(frames: IntArray | FloatArray, said: int | None = None) -> int:
    """Return the number of a recording's first frame.

    Args:
        frames: (R,) numbers that occur.
        said: what the user says, or None.

    Raises:
        DataError: `said` is neither 0 nor 1.
    """
    if said is None:
        return 0 if len(frames) and np.nanmin(frames) == 0 else 1
    if said not in FIRST_FRAMES:
        raise DataError(f"frames count from 0 or 1, not from {said}")
    return said


def split_picture_name(name: str) -> tuple[str, int] | None:
    """Split the name of a picture into what all pictures of a video share, and the number of its frame.

    The number is the last one in the name without folder and type: `cam1/frame_000012.jpg` is frame 12.

    Args:
        name: with or without folders.

    Returns:
        The name without number and type, and the number; None where it has none.
    """
    folder, mark, last = name.replace("\\", "/").rpartition("/")
    stem = re.sub(r"\.[A-Za-z]\w*$", "", last.strip())
    found = _NUMBER.search(stem)
    if found is None or len(found[0]) > _MOST_DIGITS:
        return None
    rest = stem[: found.start()] + stem[found.end() :]
    return folder.strip() + mark + rest.rstrip("_-. "), int(found[0])
