"""Tracks as results of MOTChallenge and KITTI, which count frames."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.arrays import IntArray, TextArray
from jeat_graph.data.column_names import BOX
from jeat_graph.data.errors import DataError
from jeat_graph.data.tables.frame_filling import check_rate
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.tables import kitti, motchallenge
from jeat_graph.io.tables.rounding import round_decimals
from jeat_graph.io.tables.table_writer import write_columns
from jeat_graph.io.tables.trajectories_io import EXISTENCE_DECIMALS, PX_DECIMALS


def write_motchallenge(table: Trajectories, path: str | Path, rate_hz: float) -> None:
    """Write boxes as a MOTChallenge result: `frame, id, left, top, width, height, existence, -1, -1, -1`.

    The format has no classes; those of CVAT have (`io/exports/cvat.py`).

    Times go to the nearest frame, counted from 1; sampling the table at frame times is the caller's business.
    Of several rows of one track in one frame the last is written.

    Raises:
        DataError: the rate is not positive, or a time lies before frame 1.
    """
    frame, kept = by_frame(table, path, rate_hz)
    boxes = round_decimals(kept.boxes, PX_DECIMALS)
    columns: dict[str, Any] = {"frame": frame + motchallenge.FIRST_FRAME, "id": kept.track_id}
    columns |= {name: boxes[:, k] for k, name in enumerate(BOX)}
    columns["conf"] = round_decimals(kept.existence, EXISTENCE_DECIMALS)
    columns |= {name: np.full(len(kept), -1) for name in ("world_x", "world_y", "world_z")}
    write_columns(columns, path, header=False)


def write_kitti(
    table: Trajectories, path: str | Path, rate_hz: float = kitti.RATE_HZ, object_type: str = "Car"
) -> None:
    """Write boxes as a KITTI tracking result, frames from 0, the 3D columns marked as unknown.

    The type is the class of each row, with `_` for white space, and `object_type` where it is unknown.

    Rows are chosen as by `write_motchallenge`; the score is the existence.

    Raises:
        DataError: the rate is not positive, a time lies before frame 0, or the type holds white space.
    """
    if object_type.split() != [object_type]:
        raise DataError(f"a KITTI object type is one word, not {object_type!r}", path)
    frame, kept = by_frame(table, path, rate_hz)
    n = len(kept)
    edges = np.concatenate([kept.boxes[:, :2], kept.boxes[:, :2] + kept.boxes[:, 2:]], axis=1)
    edges = round_decimals(edges, PX_DECIMALS)
    columns: dict[str, Any] = {"frame": frame, "id": kept.track_id, "type": _types(kept, object_type)}
    columns |= {
        name: np.full(n, value) for name, value in (("truncated", -1), ("occluded", -1), ("alpha", -10))
    }
    columns |= {name: edges[:, k] for k, name in enumerate(("left", "top", "right", "bottom"))}
    columns |= {f"size_{name}": np.full(n, -1) for name in "hwl"}
    columns |= {f"loc_{name}": np.full(n, -1000) for name in "xyz"}
    columns |= {"rotation": np.full(n, -10), "score": round_decimals(kept.existence, EXISTENCE_DECIMALS)}
    write_columns(columns, path, header=False, delimiter=" ")


def by_frame(table: Trajectories, path: str | Path, rate_hz: float) -> tuple[IntArray, Trajectories]:
    """Return frames (from 0) and rows, sorted by frame and id, the last row of each pair only."""
    frame = np.rint(table.t * check_rate(rate_hz, path)).astype(np.int64)
    if (frame < 0).any():
        raise DataError(f"t = {table.t.min():g} lies before the first frame, which is at 0 s", path)
    order = np.lexsort((np.arange(len(frame)), table.track_id, frame))
    last = np.ones(len(order), dtype=bool)
    last[:-1] = (np.diff(frame[order]) != 0) | (np.diff(table.track_id[order]) != 0)
    rows = order[last]
    return frame[rows], table.take(rows)


def _types(table: Trajectories, unknown: str) -> TextArray:
    """Class (N,) of each row as one word."""
    if table.classes is None:
        return np.full(len(table), unknown)
    names, place = np.unique(table.classes, return_inverse=True)
    words = ["_".join(name.split()) or unknown for name in names.tolist()]
    return np.array(words, dtype=np.str_)[place.reshape(-1)]
