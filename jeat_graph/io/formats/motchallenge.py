"""MOTChallenge text: `frame, id, left, top, width, height, conf, …`, frames counted from 1.

Frame k is at time (k - 1) / rate; or at k / rate in a file that has a frame 0. The rate is not in the file:
it is the caller's, or that of the `seqinfo.ini` that MOTChallenge keeps beside (or in the folder above) its
text files.

What stands in columns 8 and up differs by year and is recognised by their number: with 9 columns the file is
of 2016 or later and column 8 is the class and 9 the visibility; with 10 columns, 8 to 10 are world
coordinates, often -1, and there is no class, unless 8 holds whole numbers and 9 and 10 only marks. With 11
columns there is a class beside the world coordinates: in column 8, or in the last one if 8 has no whole
numbers from 0 up. Column 7 is a detection's confidence; in truth, 0 there marks an object that is not to be
judged.
"""

from __future__ import annotations

import configparser
from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.challenge_classes import CHALLENGE
from jeat_graph.data.class_columns import name_classes
from jeat_graph.data.column_names import BOX
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_numbers import FrameCount, first_frame
from jeat_graph.data.tables.file_table import FileTable
from jeat_graph.data.tables.frame_filling import check_rate, fill_frames
from jeat_graph.data.tables.reading import Reading
from jeat_graph.data.tables.spreadsheets import is_number
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.files.zipped import LABELS, MEMBER, read_member
from jeat_graph.io.formats.record import BoxFormat, Certainty, FileBoxes, FileHead, SequenceInfo, always
from jeat_graph.io.tables.by_frame import by_frame
from jeat_graph.io.tables.class_names import ClassNames, lines_of_names, names_by_number
from jeat_graph.io.tables.plain_text import frames_of, read_plain
from jeat_graph.io.tables.rounding import round_decimals
from jeat_graph.io.tables.table_writer import write_columns
from jeat_graph.io.tables.trajectories_io import EXISTENCE_DECIMALS, PX_DECIMALS

FIRST_FRAME = 1
_FIRST_CLASS = 1
_BASE = ("frame", "id", "left", "top", "width", "height")
_COLUMNS = {
    6: _BASE,
    7: (*_BASE, "conf"),
    8: (*_BASE, "conf", "class"),
    9: (*_BASE, "conf", "class", "visibility"),
    10: (*_BASE, "conf", "x", "y", "z"),
    11: (*_BASE, "conf", "eighth", "ninth", "tenth", "last"),
}
# Columns of 10 that may hold a class and two marks (cut off, hidden) instead of a place in the world.
_WORLD = ("x", "y", "z")
_MARKS = (np.array([-1, 0, 1]), np.array([-1, 0, 1, 2]))


def read_lines(path: str | Path) -> FileTable:
    """Read the columns `frame, id, left, top, width, height` and, if there, `conf` and `class`.

    A file without any line is a table without rows; a zip that CVAT takes or gives (`MOT 1.1`) is read as the
    text in it.

    Raises:
        DataError: names the first line with a wrong number of fields.
    """
    return read_plain(path, _COLUMNS, "MOTChallenge", read_member(path, MEMBER))


def boxes_of(table: FileTable) -> FloatArray:
    """Return left, top, width, height (R, 4) in px.

    Raises:
        DataError: names the first line where one of them is not a finite number.
    """
    return np.stack([table.number(name) for name in _BASE[2:]], axis=1)


def class_names(
    table: FileTable, given: ClassNames | None = None, challenge: bool = False
) -> np.typing.NDArray[np.str_] | None:
    """Return the class of each line (R,), or None without one.

    Args:
        table: the file's table.
        given: names of classes that the user gives.
        challenge: whether the numbers are those of the challenge where nobody says their names: so it is in
            its truth, while detectors and trackers write numbers of their own.

    Returns:
        Names; numbers as text where no name is known; empty text where a number is negative.

    Raises:
        DataError: a class that is no whole number, or a list of names that cannot be read.
    """
    column = _class_column(table)
    if column is None:
        return np.zeros(0, dtype=np.str_) if not len(table) else None
    distinct, index = np.unique(table.whole(column), return_inverse=True)
    texts = np.array(["" if number < 0 else str(number) for number in distinct], dtype=np.str_)
    names = names_by_number(given, table.path, _FIRST_CLASS)
    if names is None and table.path is not None:
        names = _names_in_zip(table.path)
    if names is None and challenge:
        names = dict(enumerate(CHALLENGE, _FIRST_CLASS))
    return name_classes(texts[index.reshape(-1)], names)


def _class_column(table: FileTable) -> str | None:
    """The column that holds classes, if there is one."""
    if "class" in table:
        return "class"
    if "last" in table and len(table):
        return next((name for name in ("eighth", "last") if _holds_classes(table.number(name))), None)
    return "x" if _class_before_marks(table) else None


def _holds_classes(numbers: FloatArray) -> bool:
    """Whether numbers (R,) are classes: whole, -1 where unknown, and known somewhere."""
    return bool(np.all((numbers == np.rint(numbers)) & (numbers >= -1)) and (numbers >= 0).any())


def _class_before_marks(table: FileTable) -> bool:
    """Whether columns 8 to 10 are a class and two marks, as VisDrone and some trackers write them."""
    if "x" not in table or not len(table):
        return False
    kind, *marks = (table.number(name) for name in _WORLD)
    return _holds_classes(kind) and all(
        np.isin(mark, known).all() for mark, known in zip(marks, _MARKS, strict=True)
    )


def _names_in_zip(path: Path) -> dict[int, str] | None:
    data = read_member(path, LABELS)
    if data is None:
        return None
    return dict(enumerate(lines_of_names(data.decode("utf-8", errors="replace")), _FIRST_CLASS))


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


def sequence_rate(
    path: str | Path, rate_hz: float | None, otherwise: float | None = None
) -> tuple[float, int | None]:
    """Return the frame rate (Hz) and the number of frames, if that is known.

    Args:
        path: the text file; `seqinfo.ini` is looked for in its folder and the one above.
        rate_hz: the caller's rate, which goes before that of the file.
        otherwise: rate where neither says one, for a file without any line.

    Raises:
        DataError: no rate is known, or it is not a positive number.
    """
    info = sequence_info(path)
    rate = info.rate_hz if rate_hz is None else rate_hz
    rate = otherwise if rate is None else rate
    if rate is None:
        raise DataError(
            "MOTChallenge text has frame numbers only; give the frame rate with --rate (in Python rate_hz)",
            path,
        )
    return check_rate(rate, path), info.length


def read_boxes(path: str | Path, how: Reading, truth: bool = False) -> FileBoxes:
    """Read detections, truth or results.

    Args:
        path: the file.
        how: what it does not say itself.
        truth: whether it is truth: that of the challenge has names for its classes.

    Raises:
        DataError: names the line and what is wrong.
    """
    table = read_lines(path)
    numbers = table.whole("frame")
    first = first_frame(numbers, how.first_frame)
    frame = frames_of(table, first) - first
    rate, length = sequence_rate(path, how.rate_hz, None if len(frame) else 1.0)
    challenge = truth and sequence_info(path).origin is not None
    conf = table.number("conf") if "conf" in table else None
    return FileBoxes(
        t=frame / rate,
        boxes=boxes_of(table),
        error=table.error,
        recorded=lambda: (fill_frames(frame + 1, path, length) - 1) / rate,
        scores=conf,
        ids=table.whole("id"),
        classes=class_names(table, how.class_names, challenge),
        ignore=None if conf is None else conf == 0,
        frames=FrameCount.of(numbers, first, usual=FIRST_FRAME)._replace(length=length),
    )


def write_motchallenge(table: Trajectories, path: str | Path, rate_hz: float) -> None:
    """Write boxes as a result: `frame, id, left, top, width, height, existence, -1, -1, -1`.

    The format has no classes; those of CVAT have (`exporting/cvat.py`).

    Times go to the nearest frame, counted from 1; sampling the table at frame times is the caller's business.
    Of several rows of one track in one frame the last is written.

    Raises:
        DataError: the rate is not positive, or a time lies before frame 1.
    """
    frame, kept = by_frame(table, path, rate_hz)
    boxes = round_decimals(kept.boxes, PX_DECIMALS)
    columns: dict[str, Any] = {"frame": frame + FIRST_FRAME, "id": kept.track_id}
    columns |= {name: boxes[:, k] for k, name in enumerate(BOX)}
    columns["conf"] = round_decimals(kept.existence, EXISTENCE_DECIMALS)
    columns |= {name: np.full(len(kept), -1) for name in ("world_x", "world_y", "world_z")}
    write_columns(columns, path, header=False)


def _recognise(head: FileHead) -> Certainty:
    """A zip of CVAT's; else a first line of numbers alone, or no line."""
    if read_member(head.path, MEMBER) is not None:
        return Certainty.SAYS
    numbers = len(head.fields) >= min(_COLUMNS) and all(map(is_number, head.fields))
    return Certainty.BY_CONTENT if numbers or head.blank else Certainty.NONE


FORMAT = BoxFormat(
    name="motchallenge",
    title="MOTChallenge",
    reads="`det.txt`, `gt.txt` and results of 6 to 11 columns, also those of VisDrone, and in a zip of "
    "CVAT's `MOT 1.1`; the frame rate from `--rate` or `seqinfo.ini`, the picture's size from "
    "`seqinfo.ini`; in truth, 0 in column 7 means ignore",
    recognise=_recognise,
    read=read_boxes,
    counts_frames=always,
    facts=sequence_info,
    suffix=".mot.txt",
    write=write_motchallenge,
)
