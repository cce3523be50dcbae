"""COCO's JSON: results with `image_id, bbox, score, category_id` for each box, or a data set.

An image's time comes from the data set's list of images (`timestamp` in s, or `frame_id` by the rate), which
also tells the images in which nothing was found; without that list it is the image's number by the rate.
Images count from 0 where one of them is 0, else from 1 (`data.frame_numbers`).
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray, TextArray
from jeat_graph.data.class_columns import name_classes
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_numbers import FrameCount, first_frame
from jeat_graph.data.tables.frame_filling import check_rate, gap_times
from jeat_graph.data.tables.reading import Reading
from jeat_graph.io.formats.record import BoxFormat, Certainty, FileBoxes, FileHead
from jeat_graph.io.tables.class_names import names_by_number
from jeat_graph.io.tables.coco_columns import Entries, read_entries
from jeat_graph.io.tables.coco_entries import WANTED, one_by_one
from jeat_graph.io.tables.coco_images import Images, read_images
from jeat_graph.io.tables.csv_text import read_bytes, read_text

_FIRST_CATEGORY = 0
_SUFFIX = ".json"


@dataclass(frozen=True, eq=False)
class CocoBoxes:
    """Boxes of a COCO file.

    Attributes:
        t: (R,) time of each box (s).
        boxes: (R, 4) left, top, width, height (px).
        scores: (R,) as the file has them, or None.
        classes: (R,) category names, or their numbers as text.
        recorded: (T,) times of all images (s) if they are listed, else None.
        ids: (R,) identity of each box, or None.
        ignore: (R,) true for boxes that are not asked for, or None.
        frames: numbers of the images, or None where these have times of their own.
        entry: (R,) number of each box's entry in the file, from 0.
    """

    t: FloatArray
    boxes: FloatArray
    scores: FloatArray | None
    classes: TextArray
    recorded: FloatArray | None
    ids: IntArray | None
    ignore: BoolArray | None
    frames: FrameCount | None
    entry: IntArray


def read_results(path: str | Path, how: Reading) -> CocoBoxes:
    """Read a list of results, or a data set with annotations.

    Args:
        path: the file.
        how: rate, needed where the images have no `timestamp`; list of images, by default the one in the file
            itself, if any; video; names of categories where the file has none.

    Raises:
        DataError: names the entry (from 1) that is not as it should be; or the file holds several videos and
            none is chosen.
    """
    text = read_text(path)
    found = read_entries(text)
    tree = _load(text, path) if found is None else found.rest
    del text
    entries = tree.get("annotations") if isinstance(tree, dict) else tree
    if isinstance(tree, dict) and "t" in tree and not isinstance(entries, list):
        raise DataError(f"holds a scan; {WANTED}", path)
    if not isinstance(entries, list):
        raise DataError("must be a list of results, or an object with `annotations`", path)
    lists: Any = _load(read_text(how.images), how.images) if how.images is not None else tree
    source = path if how.images is None else how.images
    if how.images is not None and not isinstance(lists, dict):
        raise DataError("must be an object with a list of `images`", how.images)
    lists = lists if isinstance(lists, dict) else {}
    images = read_images(lists, how, source)
    if found is None:
        found = one_by_one(entries, path, {} if images is None else images.by_name)
    return _placed(found, images, _category_names(lists.get("categories")), how, path)


def _placed(
    found: Entries, images: Images | None, names: dict[int, str], how: Reading, path: str | Path
) -> CocoBoxes:
    """Give the entries their times and the names of their classes."""
    kept = np.arange(len(found.image))
    recorded: FloatArray | None = None
    if images is None:
        counted = first_frame(found.image, how.first_frame)
        frames: FrameCount | None = FrameCount.of(found.image, counted)
        if len(found.image) and how.rate_hz is None:
            raise DataError(
                "COCO results have image ids only; give the frame rate (--rate, in Python rate_hz) "
                "or the list of images (--images)",
                path,
            )
        if len(found.image) and found.image.min() < counted:
            stray = int(np.argmin(found.image))
            raise DataError(f"entry {stray + 1}: images count from {counted}, got {found.image[stray]}", path)
        rate = 1.0 if how.rate_hz is None else check_rate(how.rate_hz, path)
        t = (found.image - counted) / rate
    else:
        frames, recorded = images.frames, np.unique(np.array(list(images.time.values()), dtype=np.float64))
        image, of_entry = np.unique(found.image, return_inverse=True)
        known = np.array([number in images.known for number in image.tolist()], dtype=bool)[of_entry]
        if not known.all():
            stray = int(np.argmin(known))
            raise DataError(
                f"entry {stray + 1}: image {found.image[stray]} is not in the list of images", path
            )
        time = np.array([images.time.get(number, np.nan) for number in image.tolist()], dtype=np.float64)
        t = time[of_entry.reshape(-1)]
        kept = np.flatnonzero(~np.isnan(t))  # those of other videos are left out
    kind, of_entry = np.unique(found.category, return_inverse=True)
    words = np.array([names.get(number, str(number)) for number in kind.tolist()], dtype=np.str_)
    classes = words[of_entry.reshape(-1)]
    given_names = names_by_number(how.class_names, path, _FIRST_CATEGORY)
    named = name_classes(classes, None if names and how.class_names is None else given_names)
    return CocoBoxes(
        t=np.asarray(t)[kept],
        boxes=found.boxes[kept],
        scores=None if found.scores is None else found.scores[kept],
        classes=(classes if named is None else named)[kept],
        recorded=recorded,
        ids=None if found.track is None else found.track[kept],
        ignore=None if found.ignore is None else found.ignore[kept],
        frames=frames,
        entry=kept,
    )


def _load(text: bytes, path: str | Path) -> Any:
    try:
        return json.loads(text.decode("utf-8"))
    except json.JSONDecodeError as error:
        if error.msg == "Extra data" and text.lstrip()[:1] == b"{":
            raise DataError(f"is JSON Lines; {WANTED}", path, error.lineno) from None
        raise DataError(f"is not JSON: {error.msg}", path, error.lineno) from None
    except (UnicodeDecodeError, RecursionError, ValueError) as error:
        raise DataError(f"is not JSON: {str(error)[:200]}", path) from None


def _category_names(categories: Any) -> dict[int, str]:
    if not isinstance(categories, list):
        return {}
    return {
        item["id"]: str(item["name"])
        for item in categories
        if isinstance(item, dict) and isinstance(item.get("id"), int) and "name" in item
    }


def read_boxes(path: str | Path, how: Reading, _truth: bool = False) -> FileBoxes:
    """Read results, or a data set.

    Raises:
        DataError: names the entry and what is wrong.
    """
    found = read_results(path, how)

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
        frames=found.frames,
    )


def _recognise(head: FileHead) -> Certainty:
    if head.suffix == _SUFFIX:
        return Certainty.NAMED
    return Certainty.BY_CONTENT if head.text[:1] in ("[", "{") else Certainty.NONE


def _counts_frames(path: str | Path) -> bool:
    return b'"timestamp"' not in read_bytes(path)


FORMAT = BoxFormat(
    name="coco",
    title="COCO",
    reads="results or a data set, JSON; times from `--images` or the data set's own list, else the image "
    "number by `--rate`; `iscrowd` or `ignore` in truth means ignore",
    recognise=_recognise,
    read=read_boxes,
    counts_frames=_counts_frames,
)
