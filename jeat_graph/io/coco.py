"""COCO detection results: JSON with `image_id, bbox, score, category_id` for each box.

An image's time comes from the data set's list of images (`timestamp` in s, or `frame_id` divided by the
rate), which also tells the images in which nothing was found; without that list it is image_id / rate.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.io.coco_columns import read_entries
from jeat_graph.io.csv_text import read_text
from jeat_graph.io.frames import check_rate

#: What is read, and what others who have JSON may do.
_WANTED = (
    "COCO results are one list of objects with image_id, bbox, score (scans as lines are for `stream`, rows "
    "with t, sensor, left, top, width, height, score for CSV or Parquet)"
)


@dataclass(frozen=True, eq=False)
class CocoBoxes:
    """Boxes of a COCO file.

    Attributes:
        t: (R,) time of each box (s).
        boxes: (R, 4) left, top, width, height (px).
        scores: (R,) as the file has them.
        classes: (R,) category names, or their numbers as text.
        recorded: (T,) times of all images (s) if they are listed, else None.
    """

    t: FloatArray
    boxes: FloatArray
    scores: FloatArray
    classes: np.typing.NDArray[np.str_]
    recorded: FloatArray | None


def read_results(path: str | Path, rate_hz: float | None, images: str | Path | None) -> CocoBoxes:
    """Read a list of results, or a data set whose annotations carry a `score`.

    Args:
        path: the results.
        rate_hz: frame rate (Hz), needed where the images have no `timestamp`.
        images: the data set's JSON with the list of images; by default the one in the file itself, if any.

    Raises:
        DataError: names the entry (from 1) that is not as it should be.
    """
    text = read_text(path)
    found = read_entries(text)
    tree = _load(text, path) if found is None else found.rest
    del text
    entries = tree.get("annotations") if isinstance(tree, dict) else tree
    if isinstance(tree, dict) and "t" in tree and not isinstance(entries, list):
        raise DataError(f"holds a scan; {_WANTED}", path)
    if not isinstance(entries, list):
        raise DataError("must be a list of results, or an object with `annotations`", path)
    lists: Any = _load(read_text(images), images) if images is not None else tree
    source = path if images is None else images
    if images is not None and not isinstance(lists, dict):
        raise DataError("must be an object with a list of `images`", images)
    lists = lists if isinstance(lists, dict) else {}
    time_of = _image_times(lists.get("images"), rate_hz, source)
    ids, boxes, scores, category = _one_by_one(entries, path) if found is None else found[:4]

    image, of_entry = np.unique(ids, return_inverse=True)
    recorded = None
    if time_of is None:
        if rate_hz is None:
            raise DataError(
                "COCO results have image ids only; give the frame rate (--rate, in Python rate_hz) "
                "or the list of images (--images)",
                path,
            )
        t = (image / check_rate(rate_hz, path))[of_entry]
    else:
        recorded = np.unique(np.array(list(time_of.values()), dtype=np.float64))
        known = np.array([number in time_of for number in image.tolist()], dtype=bool)
        if not known.all():
            stray = int(np.argmin(known[of_entry]))
            raise DataError(f"entry {stray + 1}: image {ids[stray]} is not in the list of images", path)
        t = np.array([time_of[number] for number in image.tolist()], dtype=np.float64)[of_entry]
    names = _category_names(lists.get("categories"))
    kind, of_entry = np.unique(category, return_inverse=True)
    words = np.array([names.get(number, str(number)) for number in kind.tolist()], dtype=np.str_)
    return CocoBoxes(t=t, boxes=boxes, scores=scores, classes=words[of_entry], recorded=recorded)


def _one_by_one(entries: list[Any], path: str | Path) -> tuple[IntArray, FloatArray, FloatArray, IntArray]:
    """Image (R,), box (R, 4), score (R,) and category (R,) of each entry.

    Raises:
        DataError: names the entry that is not as it should be.
    """
    rows = [_result(entry, k, path) for k, entry in enumerate(entries)]
    return (
        np.array([row[0] for row in rows], dtype=np.int64),
        np.array([row[1] for row in rows], dtype=np.float64).reshape(-1, 4),
        np.array([row[2] for row in rows], dtype=np.float64),
        np.array([row[3] for row in rows], dtype=np.int64),
    )


def _load(text: bytes, path: str | Path) -> Any:
    try:
        return json.loads(text.decode("utf-8"))
    except json.JSONDecodeError as error:
        if error.msg == "Extra data" and text.lstrip()[:1] == b"{":
            raise DataError(f"is JSON Lines; {_WANTED}", path, error.lineno) from None
        raise DataError(f"is not JSON: {error.msg}", path, error.lineno) from None
    except (UnicodeDecodeError, RecursionError, ValueError) as error:
        raise DataError(f"is not JSON: {str(error)[:200]}", path) from None


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError
    number = float(value)
    if not np.isfinite(number):
        raise ValueError
    return number


def _result(entry: Any, k: int, path: str | Path) -> tuple[int, tuple[float, ...], float, int]:
    """Check one entry: image, box, score, category."""
    where = f"entry {k + 1}:"
    if not isinstance(entry, dict):
        raise DataError(f"{where} must be an object with image_id, bbox, score, category_id", path)
    for name in ("image_id", "category_id"):
        if name == "image_id" and name not in entry and "t" in entry:
            raise DataError(f"{where} has t and no image_id; {_WANTED}", path)
        value = entry.get(name, 0 if name == "category_id" else None)
        if isinstance(value, bool) or not isinstance(value, int) or abs(value) > 2**53:
            raise DataError(f"{where} {name} must be a whole number", path)
    box = entry.get("bbox")
    try:
        if not isinstance(box, list):
            raise TypeError
        left, top, width, height = (_number(value) for value in box)
    except (TypeError, ValueError, OverflowError):
        raise DataError(f"{where} bbox must be four finite numbers", path) from None
    try:
        score = _number(entry.get("score"))
    except (TypeError, ValueError, OverflowError):
        raise DataError(f"{where} score must be a finite number", path) from None
    return entry["image_id"], (left, top, width, height), score, entry.get("category_id", 0)


def _image_times(images: Any, rate_hz: float | None, path: str | Path) -> dict[int, float] | None:
    if images is None:
        return None
    if not isinstance(images, list):
        raise DataError("`images` must be a list", path)
    times: dict[int, float] = {}
    for k, image in enumerate(images):
        if (
            not isinstance(image, dict)
            or isinstance(image.get("id"), bool)
            or not isinstance(image.get("id"), int)
        ):
            raise DataError(f"image {k + 1}: must be an object with a whole number as `id`", path)
        try:
            if "timestamp" in image:
                times[image["id"]] = _number(image["timestamp"])
                continue
            frame = _number(image.get("frame_id", image["id"]))
        except (TypeError, ValueError, OverflowError):
            raise DataError(f"image {k + 1}: timestamp and frame_id must be finite numbers", path) from None
        if rate_hz is None:
            raise DataError(
                f"image {k + 1} has no `timestamp`; give the frame rate (--rate, in Python rate_hz)", path
            )
        times[image["id"]] = frame / check_rate(rate_hz, path)
    return times


def _category_names(categories: Any) -> dict[int, str]:
    if not isinstance(categories, list):
        return {}
    return {
        item["id"]: str(item["name"])
        for item in categories
        if isinstance(item, dict) and isinstance(item.get("id"), int) and "name" in item
    }
