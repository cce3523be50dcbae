"""Checks that the disk has room for a data set, before it starts and while its segments grow."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

from jeat_graph.data.errors import DataError

# Bytes per pixel and frame that a segment takes at most as a rule: noise is what compresses worst.
_VIDEO_BYTES = {"mp4": 0.3, "lossless": 2.5, "png": 2.5}
_EVENT_BYTES = {"gzip": 3.5, "blosc": 3.5, "none": 10.0}
_EVENTS_PER_PIXEL = 1.0  # and frame
_MARGIN = 1.2  # over the largest segment so far
_RESERVE = 50_000_000  # left for manifest, annotations and others
#: Below this (bytes) a disk counts as full: libraries keep that much back and write it when they please.
_LEAST = 16_000_000
FULL = "the disk is full; what is done is kept, run again to go on when there is room"


def segment_bound(size_px: tuple[int, int], frames: int, video: str, compression: str) -> int:
    """Return what one segment will hardly exceed (bytes), before there is one."""
    per_pixel = _VIDEO_BYTES[video] + _EVENTS_PER_PIXEL * _EVENT_BYTES[compression]
    return int(per_pixel * size_px[0] * size_px[1] * frames)


def check_room(root: Path, remaining: int, sizes: Sequence[int], bound: int, at_once: int) -> None:
    """Check that the disk has room for the segments that are still to be made.

    Args:
        root: the data set's folder; it or one above it exists.
        remaining: segments still to be made.
        sizes: bytes of those that are there; the largest stands for the others. Without any, only the
            `at_once` segments that are made first must fit, by `bound`.
        bound: what `segment_bound` says.
        at_once: segments made at the same time.

    Raises:
        DataError: there is not enough room, with how much is needed.
    """
    if remaining <= 0:
        return
    need = int(_MARGIN * max(sizes)) * remaining if sizes else bound * min(at_once, remaining)
    need += _RESERVE
    place = root
    while not place.exists():
        place = place.parent
    free = shutil.disk_usage(place).free
    if need > free:
        kept = "; what is done is kept, run again to go on" if sizes else ""
        raise DataError(
            f"{remaining} segments need about {need / 1e9:.3g} GB, and {free / 1e9:.3g} GB are free{kept}",
            root,
        )


def disk_is_full(place: Path) -> bool:
    """Tell whether the disk of a folder has too little room to go on writing."""
    return shutil.disk_usage(place).free < _LEAST


def check_disk(place: Path) -> None:
    """Check while writing that the disk is not full.

    Raises:
        DataError: it is.
    """
    if disk_is_full(place):
        raise DataError(FULL, place)
