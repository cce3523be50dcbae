"""The list of images of a COCO data set: when each was taken, and of which video it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_numbers import FrameCount, first_frame, split_picture_name
from jeat_graph.data.notes import note
from jeat_graph.data.tables.frame_filling import check_rate
from jeat_graph.data.tables.reading import Reading
from jeat_graph.data.videos import choose_video
from jeat_graph.io.tables.coco_entries import finite_number

#: What says an image's frame: of video data sets, and of TAO and YouTube-VIS.
_FRAME_KEYS = ("frame_id", "frame_index")


class Images(NamedTuple):
    """The images of one video.

    Attributes:
        time: when each was taken (s), by its id.
        known: ids of the images of all videos.
        by_name: id of each image by its file name and by that without folder and type.
        frames: numbers of the images, or None where these have times of their own.
    """

    time: dict[int, float]
    known: set[int]
    by_name: dict[str, int]
    frames: FrameCount | None


def read_images(tree: Mapping[str, Any], how: Reading, path: str | Path) -> Images | None:
    """Read the list of images; None where there is none.

    Args:
        tree: the data set.
        how: rate and first frame, needed where images have no `timestamp`; and the video.
        path: the file, for messages.

    Raises:
        DataError: an image that is not as it should be; or several videos and none chosen.
    """
    images = tree.get("images")
    if images is None:
        return None
    if not isinstance(images, list):
        raise DataError("`images` must be a list", path)
    for k, image in enumerate(images):
        number = image.get("id") if isinstance(image, dict) else None
        if isinstance(number, bool) or not isinstance(number, int):
            raise DataError(f"image {k + 1}: must be an object with a whole number as `id`", path)
    known = {image["id"] for image in images}
    by_name: dict[str, int] = {}
    for image in images:
        name = str(image.get("file_name", ""))
        by_name.setdefault(Path(name).stem, image["id"])
        by_name[name] = image["id"]
    own = _of_one_video(images, tree, how, path)
    rate_hz = how.rate_hz if how.rate_hz is not None else _rate_of(own, tree)
    time, frames = _times(own, replace(how, rate_hz=rate_hz), path)
    return Images(time, known, by_name, frames)


def _of_one_video(
    images: list[dict[str, Any]], tree: Mapping[str, Any], how: Reading, path: str | Path
) -> list[tuple[int, dict[str, Any]]]:
    """The images of the chosen video, each with its place in the list."""
    labels = [image.get("video_id", image.get("video")) for image in images]
    videos = tree.get("videos")
    names = {
        video["id"]: str(video.get("name", video.get("file_name", "")))
        for video in (videos if isinstance(videos, list) else [])
        if isinstance(video, dict) and isinstance(video.get("id"), int | str)
    }

    def spoken(label: Any) -> str:
        name = names.get(label, "") if isinstance(label, int | str) else ""
        return f"{label} ({name})" if name and name != str(label) else str(label)

    distinct = sorted({spoken(label) for label in labels if label is not None})
    chosen = choose_video(distinct, how.video, path)
    return [
        (k, image)
        for k, (image, label) in enumerate(zip(images, labels, strict=True))
        if chosen is None or label is None or spoken(label) == chosen
    ]


def _rate_of(images: list[tuple[int, dict[str, Any]]], tree: Mapping[str, Any]) -> float | None:
    """Frames per second (Hz) that the data set says of the images' video (`fps`); None where it does not."""
    videos = tree.get("videos")
    labels = {image.get("video_id") for _, image in images}
    found = {
        video.get("fps")
        for video in (videos if isinstance(videos, list) else [])
        if isinstance(video, dict) and isinstance(video.get("id"), int | str) and video["id"] in labels
        if isinstance(video.get("fps"), int | float) and not isinstance(video["fps"], bool)
    }
    return next((float(one) for one in found if one is not None), None) if len(found) == 1 else None


def _frame_number(image: Mapping[str, Any], named: Mapping[int, int]) -> float:
    """Number of an image's frame: as it says, as its name says, else its id.

    Raises:
        TypeError, ValueError, OverflowError: what it says is no finite number.
    """
    declared = next((image[key] for key in _FRAME_KEYS if key in image), None)
    return finite_number(named.get(image["id"], image["id"]) if declared is None else declared)


def _numbers_in_names(images: list[dict[str, Any]]) -> dict[int, int]:
    """Frame number in the file name of each image, by its id; empty unless the names number the frames.

    They do where no image says its frame or time, all names differ by a number only, and no number is
    there twice. A name then says when a picture was taken, an id only which it is.
    """
    parts = {image["id"]: split_picture_name(str(image.get("file_name", ""))) for image in images}
    found = {number: part for number, part in parts.items() if part is not None}
    numbers = [part[1] for part in found.values()]
    same_size = len({part[0] for part in found.values()}) == 1
    whole = len(found) == len(images) and len(set(numbers)) == len(numbers)
    declared = any(key in image for image in images for key in ("timestamp", *_FRAME_KEYS))
    return {number: part[1] for number, part in found.items()} if same_size and whole and not declared else {}


def _times(
    images: list[tuple[int, dict[str, Any]]], how: Reading, path: str | Path
) -> tuple[dict[int, float], FrameCount | None]:
    """Time (s) of each image by its id, and their numbers where they count."""
    named = _numbers_in_names([image for _, image in images])
    if any(named[image["id"]] != image["id"] for _, image in images if image["id"] in named):
        note(f"{path}: frames are numbered as the names of the pictures number them, not as their ids do")
    stamped: dict[int, float] = {}
    counted: dict[int, float] = {}
    for k, image in images:
        try:
            if "timestamp" in image:
                stamped[image["id"]] = finite_number(image["timestamp"])
            else:
                counted[image["id"]] = _frame_number(image, named)
        except (TypeError, ValueError, OverflowError):
            raise DataError(
                f"image {k + 1}: timestamp, frame_id and frame_index must be finite numbers", path
            ) from None
        if how.rate_hz is None and "timestamp" not in image:
            raise DataError(
                f"image {k + 1} has no `timestamp`; give the frame rate (--rate, in Python rate_hz)", path
            )
    if not counted:
        return stamped, None
    numbers = np.array(list(counted.values()))
    first = first_frame(numbers, how.first_frame)
    rate = check_rate(how.rate_hz or 0.0, path)
    times = {number: (frame - first) / rate for number, frame in counted.items()}
    return stamped | times, FrameCount.of(numbers, first)
