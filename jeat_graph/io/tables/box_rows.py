"""Boxes of any format that is not a table: what detections, truth and results are made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray, TextArray
from jeat_graph.data.class_columns import LISTS_COUNT_FROM, name_classes
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_numbers import first_frame
from jeat_graph.data.notes import note
from jeat_graph.data.tables.frame_filling import check_rate, fill_frames, gap_times
from jeat_graph.data.tables.reading import Reading
from jeat_graph.io.tables import coco, kitti, motchallenge, prophesee
from jeat_graph.io.tables.class_names import names_by_number
from jeat_graph.io.tables.plain_text import frames_of
from jeat_graph.io.tables.yolo_labels import read_labels


@dataclass(frozen=True, eq=False)
class FileBoxes:
    """Boxes of one camera.

    Attributes:
        t: (R,) time of each (s).
        boxes: (R, 4) left, top, width, height (px).
        error: makes an error that names a row's (from 0) place in the file.
        recorded: gives all times (T,) at which the file says, or lets suppose, that it was looked (s).
        scores: (R,) as the file has them; None where it has none.
        ids: (R,) identities, or None.
        classes: (R,) names, or numbers as text, or None.
        ignore: (R,) true for what is not to be judged, or None.
        distance: (R,) from the camera (m), NaN where unknown, or None.
        first: number of the first frame where the file counts frames and does not fix that, else None.
    """

    t: FloatArray
    boxes: FloatArray
    error: Callable[[int, str], DataError]
    recorded: Callable[[], FloatArray]
    scores: FloatArray | None = None
    ids: IntArray | None = None
    classes: TextArray | None = None
    ignore: BoolArray | None = None
    distance: FloatArray | None = None
    first: int | None = None

    def take(self, rows: IntArray) -> FileBoxes:
        """Return some of the boxes, whose errors still name the file's own places."""
        columns: dict[str, Any] = {
            name: getattr(self, name) for name in ("scores", "ids", "classes", "ignore", "distance")
        }
        columns = {name: None if column is None else column[rows] for name, column in columns.items()}
        return replace(
            self,
            t=self.t[rows],
            boxes=self.boxes[rows],
            error=lambda row, message: self.error(int(rows[row]), message),
            **columns,
        )


def read_rows(path: str | Path, kind: str, how: Reading, *, truth: bool = False) -> FileBoxes:
    """Read a file.

    Args:
        path: the file, or the folder.
        kind: its format: `motchallenge`, `kitti`, `prophesee`, `coco` or `yolo`.
        how: what the file does not say itself.
        truth: whether it is truth: that of the MOTChallenge has names for its classes.

    Raises:
        DataError: names the file, the line or row, and what is wrong.
    """
    readers = {"kitti": _kitti, "prophesee": _prophesee, "coco": _coco, "yolo": _yolo}
    if kind == "motchallenge":
        return _motchallenge(path, how, truth)
    return readers[kind](path, how)


def _motchallenge(path: str | Path, how: Reading, truth: bool) -> FileBoxes:
    table = motchallenge.read_lines(path)
    numbers = table.whole("frame")
    first = first_frame(numbers, how.first_frame)
    frame = frames_of(table, first) - first
    rate, length = motchallenge.sequence_rate(path, how.rate_hz, None if len(frame) else 1.0)
    if len(frame) and first != motchallenge.FIRST_FRAME and how.first_frame is None:
        note(f"{path}: frames count from {first}, for there is a frame {first}")
    challenge = truth and motchallenge.sequence_info(path).origin is not None
    conf = table.number("conf") if "conf" in table else None
    return FileBoxes(
        t=frame / rate,
        boxes=motchallenge.boxes_of(table),
        error=table.error,
        recorded=lambda: (fill_frames(frame + 1, path, length) - 1) / rate,
        scores=conf,
        ids=table.whole("id"),
        classes=motchallenge.class_names(table, how.class_names, challenge),
        ignore=None if conf is None else conf == 0,
    )


def _kitti(path: str | Path, how: Reading) -> FileBoxes:
    table = kitti.read_lines(path)
    rate = check_rate(kitti.RATE_HZ if how.rate_hz is None else how.rate_hz, path)
    first = kitti.FIRST_FRAME if how.first_frame is None else how.first_frame
    frame = frames_of(table, first) - first
    classes = table.text("type")
    return FileBoxes(
        t=frame / rate,
        boxes=kitti.boxes_of(table),
        error=table.error,
        recorded=lambda: fill_frames(frame, path) / rate,
        scores=table.number("score") if "score" in table else None,
        ids=table.whole("id"),
        classes=classes,
        ignore=classes == kitti.NO_OBJECT,
        distance=kitti.distances_of(table),
    )


def _prophesee(path: str | Path, how: Reading) -> FileBoxes:
    table = prophesee.read_array(path)
    t = prophesee.times_of(table)
    names = names_by_number(how.class_names, path, LISTS_COUNT_FROM)

    def recorded() -> FloatArray:
        gaps = np.zeros(0) if how.rate_hz is None else gap_times(t, how.rate_hz, path)
        return np.union1d(t, gaps)

    return FileBoxes(
        t=t,
        boxes=prophesee.boxes_of(table),
        error=table.error,
        recorded=recorded,
        scores=table.number("class_confidence") if "class_confidence" in table else None,
        ids=table.whole("track_id") if "track_id" in table else None,
        classes=name_classes(prophesee.class_names(table), names),
    )


def _coco(path: str | Path, how: Reading) -> FileBoxes:
    found = coco.read_results(path, how)

    def error(row: int, message: str) -> DataError:
        return DataError(f"entry {found.entry[row] + 1}: {message}", path)

    def recorded() -> FloatArray:
        if found.recorded is not None:
            return found.recorded
        gaps = np.zeros(0) if how.rate_hz is None else gap_times(found.t, how.rate_hz, path)
        return np.union1d(found.t, gaps)

    return FileBoxes(
        t=found.t,
        boxes=found.boxes,
        error=error,
        recorded=recorded,
        scores=found.scores,
        ids=found.ids,
        classes=found.classes,
        ignore=found.ignore,
        first=found.first,
    )


def _yolo(path: str | Path, how: Reading) -> FileBoxes:
    labels = read_labels(path, how)
    first = first_frame(labels.looked, how.first_frame)
    if how.rate_hz is None:
        raise DataError("has frame numbers only; give their rate with --rate (in Python rate_hz)", path)
    rate = check_rate(how.rate_hz, path)
    return FileBoxes(
        t=(labels.frame - first) / rate,
        boxes=labels.boxes,
        error=labels.error,
        recorded=lambda: (fill_frames(labels.looked, path) - first) / rate,
        scores=labels.scores,
        ids=labels.ids,
        classes=name_classes(
            labels.kind.astype(np.str_), names_by_number(how.class_names, path, LISTS_COUNT_FROM)
        ),
    )
