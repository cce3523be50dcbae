"""A table of detections: which rows are boxes, which only say that a scan took place, and what they hold."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray, TextArray
from jeat_graph.data.box_std import STD_COLUMNS, find_bad_std, known_std
from jeat_graph.data.boxes import find_bad_row, without_area
from jeat_graph.data.camera_motion import CAMERA_MOTION, MOTION_NUMBERS, bad_motions, motion_rows
from jeat_graph.data.column_names import BOX, DEFAULT_SENSOR, standing_in
from jeat_graph.data.embeddings import EmbeddingArray, find_bad_embedding, unit_embeddings
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_columns import ASIDE
from jeat_graph.data.frame_numbers import FrameCount
from jeat_graph.data.tables.columns import Times, boxes_of, classes_of, of_one_video, times_of
from jeat_graph.data.tables.file_table import FileTable
from jeat_graph.data.tables.frame_filling import check_rate, fill_frames, scale_scores, score_hint
from jeat_graph.data.tables.frame_table import table_of_frame
from jeat_graph.data.tables.reading import Reading

#: Columns that a table of detections needs, or others that can stand for them, and those that it may have.
REQUIRED = ("t", *BOX)
OPTIONAL = ("sensor", "score", *STD_COLUMNS, "embedding", CAMERA_MOTION, *ASIDE)


class DetectionRows(NamedTuple):
    """Rows of a table of detections, checked.

    Attributes:
        t: (R,) s.
        sensors: their names, in alphabetical order; each occurs.
        code: (R,) index into them.
        boxes: (R, 4) left, top, width, height (px).
        scores: (R,) in [0, 1].
        classes: (R,) names, empty where unknown; or None.
        empty: (R,) true where a row only says that its scan took place.
        embeddings: (R, E), or None.
        camera_motion: (R, 11), NaN in rows that say nothing of it; or None.
        box_std: (R, 4) standard deviations of the sides (px), NaN where unknown; or None.
        dropped: rows whose box has no area; they are among the empty ones.
        frames: the frame numbers where the table counts frames, else None.
    """

    t: FloatArray
    sensors: list[str]
    code: IntArray
    boxes: FloatArray
    scores: FloatArray
    classes: TextArray | None
    empty: BoolArray
    embeddings: EmbeddingArray | None
    camera_motion: FloatArray | None
    box_std: FloatArray | None
    dropped: int
    frames: FrameCount | None


def rows_of_detections(
    table: FileTable, how: Reading, names: Mapping[int, str] | None, sensor: str | None
) -> DetectionRows:
    """Read the rows of a table.

    Args:
        table: with the columns `REQUIRED`, or others that stand for them.
        how: what the table does not say itself.
        names: of classes by number, or None.
        sensor: name of the one sensor, which renames that of the table; None where the table says it, or
            counts frames.

    Raises:
        DataError: names the row and what is wrong.
    """
    table = of_one_video(table, how)
    times = times_of(table, how)
    t = times.t
    named = [""]
    code = np.zeros(len(t), dtype=np.int64)
    if sensor is None and "sensor" not in table:
        sensor = DEFAULT_SENSOR
    if "sensor" in table:
        named, code = table.words("sensor", blank_ok=sensor is not None)
    if sensor is not None:
        if len(named) > 1:
            raise DataError(
                f"holds the sensors {', '.join(named)}; none can be renamed to {sensor}", table.path
            )
        named = [sensor] if len(t) else []
    empty = rows_without_box(table)
    boxes = boxes_of(table)
    scores = table.number("score", blank_ok=True) if "score" in table else np.where(empty, np.nan, 1.0)
    scores = scale_scores(scores, how.score_scale, table.path) if "score" in table else scores
    classes = classes_of(table, names)
    embedded = read_embeddings(table) if "embedding" in table else None
    flat = without_area(boxes) & ~empty
    check_rows(boxes, scores, empty | flat, table.error)
    motions = read_motions(table) if CAMERA_MOTION in table else None
    found = boxes, scores, classes, empty | flat, embedded, motions, read_std(table)
    rows = DetectionRows(t, named, code, *found, int(flat.sum()), times.count)
    fills = times.frames is not None and "sensor" not in table and not empty.any() and how.fill_empty
    return _with_frames_between(rows, times, how, table) if fills and len(t) and embedded is None else rows


def rows_of_frame(frame: Any, how: Reading, sensor: str = DEFAULT_SENSOR) -> DetectionRows:
    """Read the rows of a data frame, as `rows_of_detections` does those of a file.

    Args:
        frame: the data frame.
        how: what it does not say itself.
        sensor: name of the sensor where the frame has no such column.
    """
    table = table_of_frame(frame, REQUIRED, OPTIONAL, "detections")
    return rows_of_detections(table, how, how.listed_classes(), None if "sensor" in table else sensor)


def _with_frames_between(rows: DetectionRows, times: Times, how: Reading, table: FileTable) -> DetectionRows:
    """Add an empty scan for each frame between the first and the last of which the table says nothing."""
    assert times.frames is not None
    rate = check_rate(how.rate_hz or 0.0, table.path)
    missing = np.setdiff1d((fill_frames(times.frames, table.path) - (times.first or 0)) / rate, rows.t)
    count = len(missing)
    classes = rows.classes
    return rows._replace(
        t=np.concatenate([rows.t, missing]),
        code=np.concatenate([rows.code, np.zeros(count, dtype=np.int64)]),
        boxes=np.concatenate([rows.boxes, np.full((count, 4), np.nan)]),
        scores=np.concatenate([rows.scores, np.full(count, np.nan)]),
        classes=None if classes is None else np.concatenate([classes, np.zeros(count, dtype="U1")]),
        empty=np.concatenate([rows.empty, np.ones(count, dtype=bool)]),
        camera_motion=None
        if rows.camera_motion is None
        else np.concatenate([rows.camera_motion, np.full((count, MOTION_NUMBERS), np.nan)]),
        box_std=None if rows.box_std is None else np.concatenate([rows.box_std, np.full((count, 4), np.nan)]),
    )


def read_embeddings(table: FileTable) -> EmbeddingArray | None:
    """What the rows (R, E) look like; None where no row says it."""
    vectors = table.vectors("embedding")
    bad = find_bad_embedding(vectors)
    if bad is not None:
        raise table.error(bad, "embedding must be finite and not all zero")
    found = unit_embeddings(vectors, len(vectors))
    return None if np.isnan(found).all() else found


def read_std(table: FileTable) -> FloatArray | None:
    """How sure the detector is of the sides of rows (R, 4), in px; None where no row says it."""
    there = [name for name in STD_COLUMNS if name in table]
    if not there:
        return None
    found = np.full((len(table), 4), np.nan)
    for name in there:
        found[:, STD_COLUMNS.index(name)] = table.number(name, blank_ok=True)
    bad = find_bad_std(found)
    if bad is not None:
        raise table.error(*bad)
    return known_std(found)


def read_motions(table: FileTable) -> FloatArray | None:
    """How the camera moved (R, 11) before the scans of rows; None where no row says it."""
    vectors = table.vectors(CAMERA_MOTION)
    try:
        found = motion_rows(vectors)
    except DataError as error:
        raise table.error(int(np.argmin(np.isnan(vectors[:, 0]))), error.message) from None
    bad = np.zeros(0, dtype=bool) if found is None else bad_motions(found)
    if bad.any():
        raise table.error(
            int(np.argmax(bad)), f"{CAMERA_MOTION} is no motion: {vectors[np.argmax(bad)].tolist()}"
        )
    return found


def rows_without_box(table: FileTable) -> BoolArray:
    """Which rows (R,) only say that a scan took place; a row with part of a box is an error."""
    values = [*standing_in(table.names, BOX), *(name for name in ("score",) if name in table)]
    return table.bare(values, "a scan that found nothing has only t and sensor")


def check_rows(
    boxes: FloatArray, scores: FloatArray, passed_over: BoolArray, error: Callable[[int, str], DataError]
) -> None:
    """Refuse the first row that is no detection, at its place in the file, but for those passed over."""
    index = np.flatnonzero(~passed_over) if passed_over.any() else None
    bad = find_bad_row(boxes, scores) if index is None else find_bad_row(boxes[index], scores[index])
    if bad is not None:
        row = bad[0] if index is None else int(index[bad[0]])
        what = score_hint(float(scores[row])) if bad[1].startswith("score") else bad[1]
        raise error(row, what)
