"""The entries of a COCO file one by one: slower than as columns, but it says what is wrong."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_numbers import split_picture_name
from jeat_graph.io.tables.coco_columns import Entries

#: What is read, and what others who have JSON may do.
WANTED = (
    "COCO results are one list of objects with image_id, bbox, score (scans as lines are for `stream`, rows "
    "with t, sensor, left, top, width, height, score for CSV or Parquet)"
)
_LARGEST = 2**53  # beyond it a float cannot tell neighbouring whole numbers apart


class _Entry(NamedTuple):
    """One entry, checked."""

    image: int
    box: tuple[float, ...]
    score: float | None
    category: int
    track: int | None
    ignore: bool


def one_by_one(entries: list[Any], path: str | Path, by_name: Mapping[str, int]) -> Entries:
    """Read entries, as `coco_columns.read_entries` does.

    Args:
        entries: the list.
        path: the file, for messages.
        by_name: id of each image by its file name, for entries that name their image.

    Raises:
        DataError: names the entry (from 1) that is not as it should be.
    """
    rows = [_row(entry, k, path, by_name) for k, entry in enumerate(entries)]
    without = [k for k, row in enumerate(rows) if row.score is None]
    if without and len(without) < len(rows):
        raise DataError(f"entry {without[0] + 1}: score is missing", path)
    lost = [k for k, row in enumerate(rows) if row.track is None]
    if lost and len(lost) < len(rows):
        raise DataError(f"entry {lost[0] + 1}: track_id is missing", path)
    return Entries(
        image=np.array([row.image for row in rows], dtype=np.int64),
        boxes=np.array([row.box for row in rows], dtype=np.float64).reshape(-1, 4),
        scores=None if without else np.array([row.score for row in rows], dtype=np.float64),
        category=np.array([row.category for row in rows], dtype=np.int64),
        rest=None,
        track=None if lost else np.array([row.track for row in rows], dtype=np.int64),
        ignore=np.array([row.ignore for row in rows], dtype=np.bool_),
    )


def finite_number(value: Any) -> float:
    """Return a number of JSON.

    Raises:
        TypeError, ValueError, OverflowError: it is none, or not finite.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError
    number = float(value)
    if not np.isfinite(number):
        raise ValueError
    return number


def _row(entry: Any, k: int, path: str | Path, by_name: Mapping[str, int]) -> _Entry:
    where = f"entry {k + 1}:"
    if not isinstance(entry, dict):
        raise DataError(f"{where} must be an object with image_id, bbox, score, category_id", path)
    if "image_id" not in entry and "t" in entry:
        raise DataError(f"{where} has t and no image_id; {WANTED}", path)
    image = _image(entry.get("image_id"), by_name)
    category = entry.get("category_id", 0)
    for name, number in (("image_id", image), ("category_id", category)):
        if not _is_whole(number):
            raise DataError(f"{where} {name} must be a whole number", path)
    box = entry.get("bbox")
    try:
        if not isinstance(box, list):
            raise TypeError
        left, top, width, height = (finite_number(value) for value in box)
    except (TypeError, ValueError, OverflowError):
        raise DataError(f"{where} bbox must be four finite numbers", path) from None
    try:
        score = finite_number(entry["score"]) if "score" in entry else None
    except (TypeError, ValueError, OverflowError):
        raise DataError(f"{where} score must be a finite number", path) from None
    track = _track(entry)
    if track is not None and not _is_whole(track):
        raise DataError(f"{where} track_id must be a whole number", path)
    ignore = bool(entry.get("iscrowd") or entry.get("ignore"))
    return _Entry(image, (left, top, width, height), score, category, track, ignore)


def _image(image: Any, by_name: Mapping[str, int]) -> Any:
    """Number of an image that an entry gives by number or by name."""
    if not isinstance(image, str):
        return image
    if image in by_name:
        return by_name[image]
    parts = split_picture_name(image)
    return image if parts is None else parts[1]


def _track(entry: Mapping[str, Any]) -> Any:
    attributes = entry.get("attributes")
    within = attributes.get("track_id") if isinstance(attributes, dict) else None
    return entry.get("track_id", entry.get("instance_id", within))


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) <= _LARGEST
