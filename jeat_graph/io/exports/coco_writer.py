"""Write ground truth as a COCO data set: `images`, `annotations`, `categories` (see `coco` for results).

Beyond COCO's own keys, an image has `timestamp` (s), `frame_id` and `video`, and an annotation `track_id` and
`visible`. Boxes that are not asked for have `iscrowd` 1, which COCO's evaluation neither counts as missed nor
holds against a detection.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.io.files.atomic import open_atomic
from jeat_graph.io.tables.csv_text import read_text

_US_PER_S = 1e6
_MOST_FRAMES = 100_000  # of a video, so that image ids of different videos never meet
_MOST_BOXES = 1000  # of an image, likewise
_DIGITS = 3  # of boxes (px)


def coco_images(
    video: str, video_number: int, t_us: IntArray, size_px: tuple[int, int], names: Sequence[str]
) -> list[dict[str, Any]]:
    """Describe the frames of one video.

    Args:
        video: its name.
        video_number: distinct for each video of a data set; image ids follow from it.
        t_us: (F,) time of each frame (µs).
        size_px: width and height.
        names: `file_name` of each frame.

    Raises:
        DataError: too many frames.
    """
    if len(t_us) > _MOST_FRAMES:
        raise DataError(f"{video}: more than {_MOST_FRAMES} frames")
    return [
        {
            "id": _image_id(video_number, k),
            "file_name": name,
            "width": size_px[0],
            "height": size_px[1],
            "timestamp": int(t) / _US_PER_S,
            "frame_id": k,
            "video": video,
        }
        for k, (t, name) in enumerate(zip(t_us, names, strict=True))
    ]


def coco_annotations(
    video_number: int,
    frame: IntArray,
    boxes: FloatArray,
    class_id: IntArray,
    track_id: IntArray,
    visible: FloatArray,
    ignore: BoolArray,
) -> list[dict[str, Any]]:
    """Describe the boxes of one video.

    Args:
        video_number: as for `coco_images`.
        frame: (N,) number of the frame, not decreasing.
        boxes: (N, 4) left, top, width, height (px).
        class_id: (N,) from 0; categories count from 1.
        track_id: (N,) identity within the video.
        visible: (N,) visible fraction.
        ignore: (N,) true for boxes that are not asked for.

    Raises:
        DataError: too many boxes in one frame.
    """
    first = np.searchsorted(frame, frame, side="left")
    place = np.arange(len(frame)) - first
    if len(place) and int(place.max()) >= _MOST_BOXES:
        raise DataError(f"more than {_MOST_BOXES} boxes in frame {int(frame[np.argmax(place)])}")
    rounded = boxes.round(_DIGITS)
    return [
        {
            "id": _image_id(video_number, int(frame[k])) * _MOST_BOXES + int(place[k]),
            "image_id": _image_id(video_number, int(frame[k])),
            "category_id": int(class_id[k]) + 1,
            "bbox": [float(v) for v in rounded[k]],
            "area": round(float(boxes[k, 2] * boxes[k, 3]), _DIGITS),
            "iscrowd": int(ignore[k]),
            "track_id": int(track_id[k]),
            "visible": round(float(visible[k]), _DIGITS),
        }
        for k in range(len(frame))
    ]


def coco_categories(names: npt.NDArray[np.str_] | Sequence[str]) -> list[dict[str, Any]]:
    """Number the classes from 1, in the order given."""
    return [{"id": k + 1, "name": str(name), "supercategory": "vehicle"} for k, name in enumerate(names)]


def write_coco(
    path: str | Path,
    images: Iterable[dict[str, Any]],
    annotations: Iterable[dict[str, Any]],
    categories: Iterable[dict[str, Any]],
) -> None:
    """Write a data set, one entry a line, without holding it in memory as text."""
    with open_atomic(path) as file:
        parts = (("images", images), ("annotations", annotations), ("categories", categories))
        for key, (name, entries) in zip(("{", ",", ","), parts, strict=True):
            file.write(f'{key}"{name}":[')
            for k, entry in enumerate(entries):
                file.write((",\n" if k else "\n") + json.dumps(entry, separators=(",", ":")))
            file.write("]\n")
        file.write("}\n")


def merge_coco(path: str | Path, parts: Sequence[Path], categories: Sequence[dict[str, Any]]) -> None:
    """Join data sets whose ids are distinct into one file.

    Raises:
        DataError: a part cannot be read.
    """
    write_coco(path, _entries(parts, "images"), _entries(parts, "annotations"), categories)


def _entries(parts: Sequence[Path], name: str) -> Iterator[dict[str, Any]]:
    for part in parts:
        try:
            yield from json.loads(read_text(part))[name]
        except (ValueError, KeyError, TypeError):
            raise DataError(f"is no COCO data set with {name}", part) from None


def _image_id(video_number: int, frame: int) -> int:
    return video_number * _MOST_FRAMES + frame + 1
