"""Truth from data frames, with the columns of `gt.csv`."""

from __future__ import annotations

from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.boxes import find_bad_row
from jeat_graph.data.column_names import BOX
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_columns import (
    ASIDE,
    boxes_of_columns,
    check_one_video,
    classes_of_columns,
    named_columns,
    numbers_of,
    times_of_columns,
)
from jeat_graph.data.trajectories import GroundTruth

_MOTION = ("x", "y", "vx", "vy", "ax", "ay")
_OPTIONAL = (*_MOTION, "ignore", "distance", *ASIDE)


def truth_of_frame(frame: Any, *, rate_hz: float | None = None) -> GroundTruth:
    """Read truth from a data frame, one row an object and time.

    Args:
        frame: `t` (s, or dates), `object_id` (whole numbers), a box as in detections; where there are such
            `x, y, vx, vy, ax, ay`, `class`, `ignore` and `distance`. A row with only `t` is a time without
            objects.
        rate_hz: frames per second (Hz), for a frame with frame numbers in place of times.

    Raises:
        DataError: a column is missing, or a row is no object; the message names it.
    """
    c = named_columns(frame, ("t", "object_id", *BOX), _OPTIONAL, "true boxes")
    check_one_video(c)
    t, boxes, number = (
        times_of_columns(c, "s", rate_hz),
        boxes_of_columns(c),
        numbers_of(c["object_id"], "object_id"),
    )
    if not np.isfinite(t).all():
        raise DataError(f"row {int(np.argmin(np.isfinite(t)))}: t must be finite")
    rows = np.flatnonzero(~(np.isnan(boxes).all(axis=1) & np.isnan(number)))
    boxes = np.ascontiguousarray(boxes[rows])
    bad = find_bad_row(boxes, np.ones(len(rows)))
    if bad is not None:
        raise DataError(f"row {rows[bad[0]]}: {bad[1]}")
    ids = number[rows]
    if not (np.isfinite(ids) & (np.floor(ids) == ids)).all():
        raise DataError("object_id must hold whole numbers")
    ignore = np.nan_to_num(numbers_of(c["ignore"], "ignore")[rows]) != 0.0 if "ignore" in c else ids < -np.inf
    judged = np.column_stack([t[rows], ids])[~ignore]
    if len(np.unique(judged, axis=0)) < len(judged):
        raise DataError("an object is there twice at one time")
    classes = classes_of_columns(c, len(t))
    return GroundTruth(
        t=t[rows],
        object_id=ids.astype(np.int64),
        boxes=boxes,
        motion=_motion(c, boxes, rows) if any(name in c for name in _MOTION) else None,
        ignore=ignore,
        classes=None if classes is None else classes[rows],
        distance=numbers_of(c["distance"], "distance")[rows] if "distance" in c else None,
        frames=np.unique(t),
    )


def _motion(columns: dict[str, Any], boxes: FloatArray, rows: Any) -> FloatArray:
    """Motion (N, 6) of the centres, which without columns of their own are those of the boxes (N, 4)."""
    out = np.full((len(boxes), 6), np.nan)
    out[:, :2] = boxes[:, :2] + boxes[:, 2:] / 2
    for k, name in enumerate(_MOTION):
        if name in columns:
            out[:, k] = numbers_of(columns[name], name)[rows]
    return out
