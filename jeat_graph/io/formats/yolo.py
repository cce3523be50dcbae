"""A folder of YOLO's labels: one text file a picture, one box a line, in shares of the picture.

A line is `class, centre x, centre y, width, height`, then perhaps a confidence, then perhaps a track. Files
are named after their pictures, with the frame's number last (`video_12.txt`). A picture in which nothing was
found has an empty file, or none.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.class_columns import LISTS_COUNT_FROM, name_classes
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_numbers import FrameCount, first_frame, split_picture_name
from jeat_graph.data.tables.frame_filling import check_rate, fill_frames
from jeat_graph.data.tables.reading import Reading
from jeat_graph.data.tables.spreadsheets import is_number
from jeat_graph.data.videos import choose_video
from jeat_graph.io.formats.record import BoxFormat, Certainty, FileBoxes, FileHead, always
from jeat_graph.io.tables.class_names import LISTS, names_by_number
from jeat_graph.io.tables.csv_text import read_text

_FEWEST, _MOST = 5, 7
_OTHER_FILES = frozenset((*LISTS, "train.txt", "val.txt", "test.txt", "readme.txt"))
_SUFFIX = ".txt"
_ONE_PICTURE = (
    "looks like labels of YOLO (class, centre and size in shares of the picture, one file for each): "
    "give the folder with the files of all pictures, with --image WIDTHxHEIGHT and --rate"
)


@dataclass(frozen=True, eq=False)
class Labels:
    """The labels of one video's pictures.

    Attributes:
        frame: (R,) number of each box's frame.
        kind: (R,) number of its class.
        boxes: (R, 4) left, top, width, height (px).
        scores: (R,) confidence, or None.
        ids: (R,) identity, or None.
        labelled: (T,) frames that have a file, ascending.
        place: file and line of each row.
    """

    frame: IntArray
    kind: IntArray
    boxes: FloatArray
    scores: FloatArray | None
    ids: IntArray | None
    labelled: IntArray
    place: list[tuple[Path, int]]

    def error(self, row: int, message: str) -> DataError:
        """Make an error that names the file and line of a row."""
        return DataError(message, *self.place[row])


def is_label_folder(path: str | Path) -> bool:
    """Tell whether a path is a folder with text files that are named after numbered pictures."""
    folder = Path(path)
    return folder.is_dir() and bool(_files(folder))


def read_labels(path: str | Path, how: Reading) -> Labels:
    """Read the labels of a folder.

    Raises:
        DataError: names the file and line of what is no label; the picture's size is not known; or the folder
            has labels of several videos and none is chosen.
    """
    folder = Path(path)
    if not folder.is_dir():
        raise DataError(_ONE_PICTURE, folder, 1)
    by_video: dict[str, list[tuple[int, Path]]] = {}
    for video, number, file in _files(folder):
        by_video.setdefault(video, []).append((number, file))
    chosen = choose_video(sorted(by_video), how.video, folder)
    files = sorted(by_video.get(chosen or "", []))
    if how.image is None:
        raise DataError(
            "holds boxes in shares of the picture; give its size with --image WIDTHxHEIGHT (in Python "
            "image=(width, height))",
            folder,
        )
    rows: list[list[float]] = []
    place: list[tuple[Path, int]] = []
    frames: list[int] = []
    for number, file in files:
        for line, fields in _lines(file):
            rows.append(_numbers(fields, file, line, rows))
            place.append((file, line))
            frames.append(number)
    labelled = np.array([number for number, _ in files], dtype=np.int64)
    if len(np.unique(labelled)) < len(labelled):
        twice = int(labelled[:-1][np.diff(labelled) == 0][0])
        raise DataError(f"has two files of frame {twice}", folder)
    found = np.array(rows, dtype=np.float64) if rows else np.zeros((0, _FEWEST))
    scores, ids = _score_and_track(found)
    size = np.tile(np.asarray(how.image, dtype=np.float64), 2)
    boxes = found[:, 1:5] * size
    boxes[:, :2] -= boxes[:, 2:] / 2
    labels = Labels(
        np.array(frames, dtype=np.int64), found[:, 0].astype(np.int64), boxes, scores, ids, labelled, place
    )
    return labels


def _files(folder: Path) -> list[tuple[str, int, Path]]:
    """Video, frame and path of each file of labels; hidden ones and lists of classes are none."""
    found = []
    for file in folder.iterdir():
        if file.suffix.lower() != _SUFFIX or file.name.lower() in _OTHER_FILES or file.name.startswith("."):
            continue
        parts = split_picture_name(file.name)
        if parts is not None:
            found.append((*parts, file))
    return found


def _lines(file: Path) -> list[tuple[int, list[str]]]:
    """Number and fields of each line that is not blank."""
    try:
        text = read_text(file, blank_ok=True).decode("utf-8")
    except UnicodeDecodeError:
        raise DataError("is not UTF-8; save the file as UTF-8", file) from None
    lines = re.split(r"\r\n|\n|\r", text)
    return [(k, line.split()) for k, line in enumerate(lines, 1) if line.strip()]


def _numbers(fields: list[str], file: Path, line: int, before: list[list[float]]) -> list[float]:
    """Check one line.

    Raises:
        DataError: it is no label, or has another number of fields than those before.
    """
    if not _FEWEST <= len(fields) <= _MOST:
        raise DataError(f"{len(fields)} fields, but a label of YOLO has {_FEWEST} to {_MOST}", file, line)
    if before and len(fields) != len(before[0]):
        raise DataError(f"{len(fields)} fields, but those before have {len(before[0])}", file, line)
    bad = next((field for field in fields if not is_number(field) or not np.isfinite(float(field))), None)
    if bad is not None:
        raise DataError(f"must hold finite numbers, got {bad[:40]!r}", file, line)
    numbers = [float(field) for field in fields]
    if numbers[0] < 0 or numbers[0] != int(numbers[0]):
        raise DataError(f"the class must be a whole number, got {fields[0]}", file, line)
    if min(numbers[3:5]) < 0.0:
        raise DataError("width and height must not be negative", file, line)
    return numbers


def _score_and_track(found: FloatArray) -> tuple[FloatArray | None, IntArray | None]:
    """Confidence (R,) and identity (R,); of one column alone, whole numbers beyond 1 are identities."""
    more = found.shape[1] - _FEWEST
    if more == 0:
        return None, None
    if more > 1:
        return found[:, 5], found[:, 6].astype(np.int64)
    last = found[:, 5]
    if len(last) and bool((last == np.rint(last)).all()) and last.max() > 1.0:
        return None, last.astype(np.int64)
    return last, None


def read_boxes(path: str | Path, how: Reading, _truth: bool = False) -> FileBoxes:
    """Read the labels of a folder.

    Raises:
        DataError: as `read_labels`; or no rate is given.
    """
    labels = read_labels(path, how)
    first = first_frame(labels.labelled, how.first_frame)
    rate = check_rate(how.rate_hz, path)
    if len(labels.labelled) and labels.labelled[0] < first:
        raise DataError(f"frames count from {first}, got {labels.labelled[0]}", path)
    return FileBoxes(
        t=(labels.frame - first) / rate,
        boxes=labels.boxes,
        error=labels.error,
        recorded=lambda: (fill_frames(labels.labelled, path) - first) / rate,
        scores=labels.scores,
        ids=labels.ids,
        classes=name_classes(
            labels.kind.astype(np.str_), names_by_number(how.class_names, path, LISTS_COUNT_FROM)
        ),
        frames=FrameCount.of(labels.labelled, first),
    )


def _is_label(fields: Sequence[str]) -> bool:
    """Whether the fields of a line are a class, four shares of a picture and perhaps a score and a track."""
    if not _FEWEST <= len(fields) <= _MOST or not all(map(is_number, fields)):
        return False
    x, y, width, height = map(float, fields[1:5])
    return (
        fields[0].isdigit()
        and min(width, height) > 0.0
        and max(x, y, width, height) <= 1.0
        and min(x, y) >= 0.0
    )


def _recognise(head: FileHead) -> Certainty:
    """The labels of one picture, which reading refuses: a folder is recognised as one."""
    return Certainty.BY_EXACT_CONTENT if _is_label(head.fields) else Certainty.NONE


FORMAT = BoxFormat(
    name="yolo",
    title="YOLO",
    reads="a folder of labels, one `NAME_FRAME.txt` a picture, perhaps with a score and a track in the last "
    "columns; needs `--image WxH` and `--rate`",
    recognise=_recognise,
    read=read_boxes,
    counts_frames=always,
    in_shares=True,
    is_folder=is_label_folder,
)
