"""MOTChallenge text: `frame, id, left, top, width, height, conf, …`, frames counted from 1.

Frame k is at time (k - 1) / rate. The rate is not in the file: it is the caller's, or that of the
`seqinfo.ini` that MOTChallenge keeps beside (or in the folder above) its text files.

What stands in columns 8 and up differs by year and is told by their number: with 9 columns the file is of
2016 or later and column 8 is the class and 9 the visibility; with 10 columns, 8 to 10 are world coordinates,
often -1, and there is no class. Column 7 is a detection's confidence; in truth, 0 there marks an object that
is not to be judged.
"""

from __future__ import annotations

import configparser
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.io.file_table import FileTable
from jeat_graph.io.frames import check_rate
from jeat_graph.io.plain_text import read_plain

FIRST_FRAME = 1
_BASE = ("frame", "id", "left", "top", "width", "height")
_COLUMNS = {
    6: _BASE,
    7: (*_BASE, "conf"),
    8: (*_BASE, "conf", "class"),
    9: (*_BASE, "conf", "class", "visibility"),
    10: (*_BASE, "conf", "x", "y", "z"),
}
# The labels of the 2016 and later challenges, from 1.
_CLASSES = (
    "pedestrian",
    "person_on_vehicle",
    "car",
    "bicycle",
    "motorbike",
    "non_motorized_vehicle",
    "static_person",
    "distractor",
    "occluder",
    "occluder_on_the_ground",
    "occluder_full",
    "reflection",
    "crowd",
)


def read_lines(path: str | Path) -> FileTable:
    """Read the columns `frame, id, left, top, width, height` and, if there, `conf` and `class`.

    Raises:
        DataError: names the first line with a wrong number of fields.
    """
    return read_plain(path, _COLUMNS, "MOTChallenge")


def boxes_of(table: FileTable) -> FloatArray:
    """Return left, top, width, height (R, 4) in px.

    Raises:
        DataError: names the first line where one of them is not a finite number.
    """
    return np.stack([table.number(name) for name in _BASE[2:]], axis=1)


def class_names(table: FileTable) -> np.typing.NDArray[np.str_] | None:
    """Return the class of each line (R,) by name (a number without a name as such), or None without one."""
    if "class" not in table:
        return None
    number = table.whole("class")
    distinct, index = np.unique(number, return_inverse=True)
    names = [_CLASSES[k - 1] if 1 <= k <= len(_CLASSES) else "" if k < 0 else str(k) for k in distinct]
    return np.asarray(names, dtype=np.str_)[index.reshape(-1)]


class SequenceInfo(NamedTuple):
    """What `seqinfo.ini` says of a sequence; None where it says nothing.

    Attributes:
        rate_hz: frames per second.
        length: number of frames.
        size_px: width and height of the picture.
        origin: the file.
    """

    rate_hz: float | None = None
    length: int | None = None
    size_px: tuple[int, int] | None = None
    origin: Path | None = None


def sequence_info(path: str | Path) -> SequenceInfo:
    """Read the `seqinfo.ini` in the folder of a text file or the one above.

    Raises:
        DataError: there is one that cannot be read.
    """
    folder = Path(path).resolve().parent
    info = next((p for p in (folder / "seqinfo.ini", folder.parent / "seqinfo.ini") if p.is_file()), None)
    if info is None:
        return SequenceInfo()
    parser = configparser.ConfigParser(interpolation=None)
    try:
        parser.read(info, encoding="utf-8-sig")
        rate = parser.getfloat("Sequence", "frameRate", fallback=None)
        length = parser.getint("Sequence", "seqLength", fallback=None)
        width = parser.getint("Sequence", "imWidth", fallback=None)
        height = parser.getint("Sequence", "imHeight", fallback=None)
    except (configparser.Error, ValueError, OSError) as error:
        raise DataError(f"cannot be read: {' '.join(str(error).split())}", info) from None
    size_px = (width, height) if width and height and min(width, height) > 0 else None
    return SequenceInfo(rate, length, size_px, info)


def sequence_rate(path: str | Path, rate_hz: float | None) -> tuple[float, int | None]:
    """Return the frame rate (Hz) and the number of frames, if that is known.

    Args:
        path: the text file; `seqinfo.ini` is looked for in its folder and the one above.
        rate_hz: the caller's rate, which goes before that of the file.

    Raises:
        DataError: no rate is known, or it is not a positive number.
    """
    info = sequence_info(path)
    rate = info.rate_hz if rate_hz is None else rate_hz
    if rate is None:
        raise DataError(
            "MOTChallenge text has frame numbers only; give the frame rate with --rate (in Python rate_hz)",
            path,
        )
    return check_rate(rate, path), info.length
