"""Ground truth from and to files, whatever the format."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Unpack

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.class_columns import LISTS_COUNT_FROM
from jeat_graph.data.column_names import BOX
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_numbers import FrameCount, note_first
from jeat_graph.data.tables.reading import Reading, ReadingOptions
from jeat_graph.data.tables.truth_table import (
    MOTION,
    OPTIONAL,
    REQUIRED,
    check_sizes,
    check_unique,
    truth_of_table,
)
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.io.formats.registry import recognise
from jeat_graph.io.tables.class_names import names_by_number
from jeat_graph.io.tables.file_tables import read_table
from jeat_graph.io.tables.table_writer import write_columns


def read_truth(path: str | Path, *, fmt: str | None = None, **options: Unpack[ReadingOptions]) -> GroundTruth:
    """Read ground truth from a file of any known format.

    The formats are those of `jeat_graph.io.formats` (`docs/reference/formats.md`), where their boxes have
    identities. A table (CSV, Parquet) has the columns `t, object_id, left, top, width, height`, optional `x,
    y, vx, vy, ax, ay, class, ignore, distance`; a row with only `t` is a recorded frame without objects. With
    any motion column there is motion: a column that is absent is NaN, except x and y, then the box's centre.
    Usual other names are understood, see `column_names`.

    MOTChallenge, KITTI and YOLO cannot say that a frame is empty: all frames between the first and the last
    are taken as recorded (every n-th, see `fill_frames`; to the length in `seqinfo.ini`, if there is one).
    Of files with times of their own that is done only where `rate_hz` is given.

    Args:
        path: the file.
        fmt: the format, if it should not be recognised from the file.
        options: what the file does not say itself, as `tables.reading.Reading` has it.

    Raises:
        DataError: names the file, the line or row, and what is wrong, such as an object twice at one time.
    """
    how = Reading(**options)
    truth, count = read_truth_counted(path, fmt, how)
    note_first(str(path), count, how.first_frame)
    return truth


def read_truth_counted(
    path: str | Path, fmt: str | None, how: Reading
) -> tuple[GroundTruth, FrameCount | None]:
    """Read truth as `read_truth` does, and tell the frame numbers of a file that counts frames."""
    kind = recognise(path, fmt)
    if kind.is_table:
        return _read_contract(path, how)
    rows = kind.read_boxes(path, how, truth=True)
    frames = np.unique(rows.recorded())
    if rows.ids is None and len(rows.t):
        raise DataError("has no identities (a column or field such as track_id); truth needs ids", path)
    if not len(frames):
        raise DataError("is empty, and how many frames were recorded is not known", path)
    ids = np.zeros(0, dtype=np.int64) if rows.ids is None else rows.ids
    ignore = np.zeros(len(ids), dtype=bool) if rows.ignore is None else rows.ignore
    negative = (ids < 0) & ~ignore
    if negative.any():
        row = int(np.argmax(negative))
        raise rows.error(row, f"truth needs an id, got {ids[row]}; are these detections?")
    check_sizes(rows.error, rows.boxes)
    check_unique(rows.error, rows.t, ids, ignore)
    truth = GroundTruth(
        t=rows.t,
        object_id=ids,
        boxes=rows.boxes,
        motion=None,
        ignore=np.asarray(ignore, dtype=bool),
        classes=rows.classes,
        distance=rows.distance,
        truncation=rows.truncation,
        occlusion=rows.occlusion,
        frames=frames,
    )
    return truth, rows.frames


def write_truth(truth: GroundTruth, path: str | Path) -> None:
    """Write truth as CSV, or as Parquet where the name ends so; every number is kept to the last bit.

    Frames without objects become rows with only `t`. Columns that the truth does not have are not written.
    """
    bare = np.setdiff1d(truth.frame_times(), truth.t)
    t = np.concatenate([truth.t, bare])
    order = np.argsort(t, kind="stable")
    gap = np.full(len(bare), np.nan)

    def numbers(values: FloatArray) -> FloatArray:
        return np.concatenate([values, gap])[order]

    def whole(values: IntArray) -> np.ma.MaskedArray[Any, Any]:
        padded = np.concatenate([values, np.zeros(len(bare), dtype=np.int64)])
        return np.ma.masked_array(padded[order], mask=order >= len(truth))

    columns: dict[str, Any] = {"t": t[order], "object_id": whole(truth.object_id)}
    columns |= {name: numbers(truth.boxes[:, k]) for k, name in enumerate(BOX)}
    if truth.motion is not None:
        columns |= {name: numbers(truth.motion[:, k]) for k, name in enumerate(MOTION)}
    if truth.classes is not None:
        columns["class"] = np.concatenate([truth.classes, np.zeros(len(bare), dtype="U1")])[order]
    columns["ignore"] = whole(truth.ignore.astype(np.int64))
    if truth.distance is not None:
        columns["distance"] = numbers(truth.distance)
    write_columns(columns, path)


def _read_contract(path: str | Path, how: Reading) -> tuple[GroundTruth, FrameCount | None]:
    table = read_table(path, REQUIRED, OPTIONAL, short=("t",), aliases=True)
    return truth_of_table(table, how, names_by_number(how.class_names, path, LISTS_COUNT_FROM))
