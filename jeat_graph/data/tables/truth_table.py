"""A table of truth: one row an object and time, with the columns of `gt.csv`."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.column_names import BOX, standing_in
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_columns import ASIDE
from jeat_graph.data.frame_numbers import FrameCount
from jeat_graph.data.tables.columns import boxes_of, classes_of, of_one_video, times_of
from jeat_graph.data.tables.file_table import FileTable
from jeat_graph.data.tables.reading import Reading
from jeat_graph.data.trajectories import GroundTruth

MOTION = ("x", "y", "vx", "vy", "ax", "ay")
#: Columns that a table of truth needs, or others that can stand for them, and those that it may have.
REQUIRED = ("t", "object_id", *BOX)
OPTIONAL = (*MOTION, "ignore", "distance", *ASIDE)
_TRUTH_WORDS = {"": False, "0": False, "1": True, "false": False, "true": True}


def truth_of_table(
    table: FileTable, how: Reading, names: Mapping[int, str] | None
) -> tuple[GroundTruth, FrameCount | None]:
    """Read truth from a table.

    Args:
        table: with the columns `REQUIRED`, or others that stand for them; a row with only `t` is a time
            without objects.
        how: what it does not say itself.
        names: of classes by number, or None.

    Returns:
        The truth, and its frame numbers where the table counts frames.

    Raises:
        DataError: names the row and what is wrong.
    """
    table = of_one_video(table, how)
    times = times_of(table, how)
    all_t = times.t
    values = standing_in(table.names, REQUIRED[1:])
    bare = table.bare(values, "a frame without objects has only t")
    rows = np.flatnonzero(~bare)
    boxes = boxes_of(table)
    check_sizes(table.error, np.where(bare[:, None], 1.0, boxes))
    ids, ignore = table.whole("object_id", blank_ok=True), _ignore_flags(table)
    check_unique(table.error, all_t, ids, ignore | bare)
    motion: FloatArray | None = None
    if any(name in table for name in MOTION):
        motion = np.full((len(all_t), 6), np.nan)
        motion[:, :2] = boxes[:, :2] + boxes[:, 2:] / 2
        for k, name in enumerate(MOTION):
            if name in table:
                motion[:, k] = table.number(name, blank_ok=True, nan_ok=True)
    distance = table.number("distance", blank_ok=True, nan_ok=True)[rows] if "distance" in table else None
    classes = classes_of(table, names)
    if classes is None and "class" in table:
        classes = np.zeros(len(all_t), dtype="U1")
    truth = GroundTruth(
        t=all_t[rows],
        object_id=ids[rows],
        boxes=np.ascontiguousarray(boxes[rows]),
        motion=None if motion is None else motion[rows],
        ignore=ignore[rows],
        classes=None if classes is None else classes[rows],
        distance=distance,
        frames=np.unique(all_t),
    )
    return truth, times.count


def _ignore_flags(table: FileTable) -> BoolArray:
    """Read `ignore` (R,): 1 or true, 0 or false or blank."""
    if "ignore" not in table:
        return np.zeros(len(table), dtype=bool)
    words = np.char.lower(table.text("ignore", blank_ok=True))
    distinct, index = np.unique(words, return_inverse=True)
    flags = [_TRUTH_WORDS.get(word.removesuffix(".0")) for word in distinct.tolist()]
    if None in flags:
        row = int(np.argmax(index.reshape(-1) == flags.index(None)))
        raise table.error(row, f"ignore must be 0 or 1, got {str(words[row])!r}")
    return np.asarray(flags, dtype=bool)[index.reshape(-1)]


def check_unique(
    error: Callable[[int, str], DataError], t: FloatArray, ids: IntArray, exempt: BoolArray
) -> None:
    """Refuse an object that is there twice at one time, unless it is one that is not judged."""
    rows = np.flatnonzero(~exempt)
    order = rows[np.lexsort((rows, ids[rows], t[rows]))]
    same = (np.diff(t[order]) == 0) & (np.diff(ids[order]) == 0)
    if same.any():
        row = int(order[1:][same].min())
        hint = "; are these detections, without identities?" if ids[row] < 0 else ""
        raise error(row, f"object {ids[row]} is there twice at t = {t[row]:g}{hint}")


def check_sizes(error: Callable[[int, str], DataError], boxes: FloatArray) -> None:
    """Check that widths and heights are positive.

    Args:
        error: makes an error that names the place of a row (from 0).
        boxes: (R, 4) left, top, width, height (px).

    Raises:
        DataError: names the first row with a width or height that is not positive.
    """
    bad = ~(boxes[:, 2:] > 0).all(axis=1)
    if bad.any():
        row = int(np.argmax(bad))
        raise error(row, f"width and height must be positive, got {boxes[row, 2]:g} x {boxes[row, 3]:g}")
