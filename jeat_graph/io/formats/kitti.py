"""KITTI tracking labels, detections and results: one object a line, frames counted from 0, 10 Hz.

Columns: frame, track id, type, truncated, occluded, alpha, box left, top, right, bottom (px), height, width,
length (m), location x, y, z in the camera's frame (m), rotation about y, and in results a score.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray, TextArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_numbers import FrameCount
from jeat_graph.data.tables.file_table import FileTable
from jeat_graph.data.tables.frame_filling import check_rate, fill_frames
from jeat_graph.data.tables.reading import Reading
from jeat_graph.data.tables.spreadsheets import is_number
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.formats.record import BoxFormat, Certainty, FileBoxes, FileHead, always
from jeat_graph.io.tables.by_frame import by_frame
from jeat_graph.io.tables.plain_text import frames_of, read_plain
from jeat_graph.io.tables.rounding import round_decimals
from jeat_graph.io.tables.table_writer import write_columns
from jeat_graph.io.tables.trajectories_io import EXISTENCE_DECIMALS, PX_DECIMALS

FIRST_FRAME = 0
RATE_HZ = 10.0
NO_OBJECT = "DontCare"
_UNKNOWN_LOCATION = -999.0  # the format writes -1000 where the location is not known
_LABEL = (
    *("frame", "id", "type", "truncated", "occluded", "alpha", "left", "top", "right", "bottom"),
    *("size_h", "size_w", "size_l", "loc_x", "loc_y", "loc_z", "rotation"),
)
_COLUMNS = {17: _LABEL, 18: (*_LABEL, "score")}


def read_lines(path: str | Path) -> FileTable:
    """Read the columns of the format, `score` only if it is there.

    Raises:
        DataError: names the first line with a wrong number of fields.
    """
    return read_plain(path, _COLUMNS, "KITTI tracking")


def boxes_of(table: FileTable) -> FloatArray:
    """Return left, top, width, height (R, 4) in px.

    Raises:
        DataError: names the first line where an edge is not a finite number.
    """
    left, top, right, bottom = (table.number(name) for name in ("left", "top", "right", "bottom"))
    return np.stack([left, top, right - left, bottom - top], axis=1)


def distances_of(table: FileTable) -> FloatArray:
    """Return the distance from the camera (R,) in m, NaN where the location is not known."""
    location = np.stack([table.number(name) for name in ("loc_x", "loc_y", "loc_z")], axis=1)
    known = (location > _UNKNOWN_LOCATION).all(axis=1)
    return np.where(known, np.linalg.norm(location, axis=1), np.nan)


def read_boxes(path: str | Path, how: Reading, truth: bool = False) -> FileBoxes:
    """Read labels, detections or results.

    Raises:
        DataError: names the line and what is wrong.
    """
    table = read_lines(path)
    rate = check_rate(RATE_HZ if how.rate_hz is None else how.rate_hz, path)
    first = FIRST_FRAME if how.first_frame is None else how.first_frame
    numbers = frames_of(table, first)
    frame = numbers - first
    classes = table.text("type")
    return FileBoxes(
        t=frame / rate,
        boxes=boxes_of(table),
        error=table.error,
        recorded=lambda: fill_frames(frame, path) / rate,
        scores=table.number("score") if "score" in table else None,
        ids=table.whole("id"),
        classes=classes,
        ignore=classes == NO_OBJECT,
        distance=distances_of(table),
        truncation=table.number("truncated") if truth else None,
        occlusion=table.number("occluded") if truth else None,
        frames=FrameCount.of(numbers, first)._replace(fixed=True),
    )


def write_kitti(
    table: Trajectories, path: str | Path, rate_hz: float = RATE_HZ, object_type: str = "Car"
) -> None:
    """Write boxes as a tracking result, the 3D columns marked as unknown.

    The type is the class of each row, with `_` for white space, and `object_type` where it is unknown. Rows
    are chosen as by `motchallenge.write_motchallenge`; the score is the existence.

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


def _types(table: Trajectories, unknown: str) -> TextArray:
    """Class (N,) of each row as one word."""
    if table.classes is None:
        return np.full(len(table), unknown)
    names, place = np.unique(table.classes, return_inverse=True)
    words = ["_".join(name.split()) or unknown for name in names.tolist()]
    return np.array(words, dtype=np.str_)[place.reshape(-1)]


def _recognise(head: FileHead) -> Certainty:
    """A first line of as many words as a label has, of which the third is no number."""
    words = head.line.split()
    fits = len(words) >= len(_LABEL) and "," not in head.line and not is_number(words[2])
    return Certainty.BY_CONTENT if fits else Certainty.NONE


FORMAT = BoxFormat(
    name="kitti",
    title="KITTI tracking",
    reads="labels (17 columns) or results (18, with a score), frames from 0; 10 Hz unless `--rate` says "
    "otherwise; type is the class, `DontCare` is ignored, `distance` is that of the 3D location",
    recognise=_recognise,
    read=read_boxes,
    counts_frames=always,
    rate_hz=RATE_HZ,
    suffix=".kitti.txt",
    write=write_kitti,
)
