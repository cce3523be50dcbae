"""Data that networks learn from: folders as `simulate` writes them, and pictures with COCO's annotations.

What is learned from and what is judged never share a segment: neighbouring frames are almost one picture.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.io.events.dsec_hdf5 import EventFile
from jeat_graph.io.events.indexed import IndexedFile
from jeat_graph.io.media.decoders import RgbImage
from jeat_graph.io.media.video import VIDEO_FILES, open_frames
from jeat_graph.io.tables.truth_io import read_truth
from jeat_graph_sehn.training.far_truth import asking_for_far
from jeat_graph_sehn.training.truth_at import TrueBoxes, TruthByTime

_SEGMENTS, _TRUTH, _EVENTS, _SPLIT = "segments", "gt.csv", "events.h5", "val.txt"
#: Where no split is given, one segment in so many is judged.
_JUDGED_OF = 8
_SAME_S = 1e-4


@dataclass(frozen=True)
class Picture:
    """One picture with its truth.

    Attributes:
        group: the segment that it belongs to.
        source: name of the data set.
        load: reads it, (H, W, 3) red, green, blue.
        truth: its boxes.
    """

    group: str
    source: str
    load: Callable[[], RgbImage]
    truth: TrueBoxes


@dataclass(frozen=True)
class EventSegment:
    """A recording of events with its truth.

    Attributes:
        group: the segment's folder.
        source: name of the data set.
        path: the file of events.
        truth: boxes by time.
        part: `train`, `val` or `test` where the data set's folders say it.
    """

    group: str
    source: str
    path: Path
    truth: TruthByTime
    part: str = field(default="", kw_only=True)

    def open(self) -> IndexedFile:
        """Open its events; the picture's size may be None."""
        return EventFile(self.path)


@dataclass(frozen=True)
class FusedSegment(EventSegment):
    """A recording of events with the pictures of the same pixels.

    Attributes:
        frames: where the pictures are.
        times_s: (F,) when they were taken, on the clock of the events (s).
    """

    frames: Path
    times_s: FloatArray

    def picture(self, index: int) -> RgbImage:
        """Read a picture, (H, W, 3) red, green, blue."""
        with open_frames(self.frames) as frames:
            return frames.frame(index)

    def newest(self, t: float) -> int | None:
        """Return the index of the last picture up to a time (s), or None."""
        index = int(np.searchsorted(self.times_s, t + _SAME_S, side="right")) - 1
        return None if index < 0 else index


Member = TypeVar("Member", bound=Picture | EventSegment)


@dataclass(frozen=True)
class Split(Generic[Member]):
    """What is learned from, and what is judged.

    Attributes:
        learned: for the first.
        judged: for the second.
        note: how they were parted.
    """

    learned: list[Member]
    judged: list[Member]
    note: str


def segments_of(root: Path) -> list[Path]:
    """Return the folders of a data set's segments.

    Raises:
        DataError: there are none.
    """
    inner = root / _SEGMENTS
    found = sorted(p for p in inner.iterdir() if (p / _TRUTH).is_file()) if inner.is_dir() else []
    if not found:
        raise DataError(
            "holds no segments with truth; give a folder that `simulate --sensors pictures` wrote, for "
            "pictures a COCO file (.json), for events recordings with boxes beside them (NAME_td.dat, "
            "NAME_bbox.npy)",
            root,
        )
    return found


def read_pictures(
    root: Path, far_px: float | None = None, on_read: Callable[[str], object] = lambda _: None
) -> list[Picture]:
    """Return the pictures of a folder that have truth.

    Args:
        root: as `simulate` writes it.
        far_px: ask also for far vehicles whose boxes are so wide and high (px); None: as the truth does.
        on_read: called with what is being read, again and again.

    Raises:
        DataError: there are none.
    """
    found = []
    folders = segments_of(root)
    for k, folder in enumerate(folders):
        on_read(f"{root.name}: {k} of {len(folders)} segments")
        place = next((folder / name for name in VIDEO_FILES.values() if (folder / name).exists()), None)
        if place is None:
            continue
        truth = _truth(folder, far_px)
        with open_frames(place) as frames:
            times = frames.times_s
        for index, t in enumerate(truth.times.tolist()):
            frame = int(abs(times - t).argmin())
            if abs(times[frame] - t) <= _SAME_S:
                found.append(Picture(str(folder), root.name, _Loader(place, frame), truth.at_frame(index)))
    if not found:
        raise DataError("holds no pictures; make it with --sensors pictures or rgb", root)
    return found


def read_event_segments(
    root: Path, far_px: float | None = None, on_read: Callable[[str], object] = lambda _: None
) -> list[EventSegment]:
    """Return the recordings of events of a folder; arguments as `read_pictures`.

    Raises:
        DataError: there are none.
    """
    found = []
    folders = segments_of(root)
    for k, folder in enumerate(folders):
        on_read(f"{root.name}: {k} of {len(folders)} segments")
        if (folder / _EVENTS).is_file():
            found.append(EventSegment(str(folder), root.name, folder / _EVENTS, _truth(folder, far_px)))
    if not found:
        raise DataError("holds no events; make it with --sensors pictures or events", root)
    return found


def read_fused_segments(
    root: Path, far_px: float | None = None, on_read: Callable[[str], object] = lambda _: None
) -> list[FusedSegment]:
    """Return the recordings of a folder that have pictures and events; arguments as `read_pictures`.

    Raises:
        DataError: there are none.
    """
    found = []
    for segment in read_event_segments(root, far_px, on_read):
        folder = Path(segment.group)
        place = next((folder / name for name in VIDEO_FILES.values() if (folder / name).exists()), None)
        if place is not None:
            with open_frames(place) as frames:
                times = frames.times_s
            found.append(
                FusedSegment(segment.group, segment.source, segment.path, segment.truth, place, times)
            )
    if not found:
        raise DataError("holds no pictures beside its events; make it with --sensors pictures", root)
    return found


def _truth(folder: Path, far_px: float | None) -> TruthByTime:
    truth = read_truth(folder / _TRUTH)
    return TruthByTime(truth if far_px is None else asking_for_far(truth, folder, far_px))


class _Loader:
    """Reads one frame; of a folder of pictures only its own."""

    def __init__(self, place: Path, index: int) -> None:
        self._place, self._index = place, index

    def __call__(self) -> RgbImage:
        with open_frames(self._place) as frames:
            return frames.frame(self._index)


def split_by_segment(members: Sequence[Member], roots: Sequence[Path]) -> Split[Member]:
    """Part what is learned from what is judged, segment by segment.

    A data set's own split counts (`val.txt`, or a folder `val`); where none has one, each eighth segment is
    judged. What belongs to a set's `test.txt`, or its folder `test`, is neither.
    """
    named = {name: _listed(roots, f"{name}.txt") | _parted(members, name) for name in ("val", "test")}
    open_ones = [m for m in members if m.group not in named["test"]]
    groups = list(dict.fromkeys(m.group for m in open_ones))
    chosen = {group for group in groups if group in named["val"]}
    note = f"{len(chosen)} segments of the sets' own `val` are judged"
    if not chosen:
        chosen = set(groups[min(_JUDGED_OF // 2, len(groups) - 1) :: _JUDGED_OF])
        note = f"each eighth segment is judged: {len(chosen)} of {len(groups)}"
    if not chosen or len(chosen) == len(groups):
        return Split(open_ones, open_ones, "too few segments to part: what is learned is judged too")
    learned = [m for m in open_ones if m.group not in chosen]
    return Split(learned, [m for m in open_ones if m.group in chosen], note)


def _parted(members: Sequence[Picture | EventSegment], name: str) -> set[str]:
    return {m.group for m in members if isinstance(m, EventSegment) and m.part == name}


def _listed(roots: Sequence[Path], name: str) -> set[str]:
    found = set()
    for root in roots:
        if root.is_dir() and (root / name).is_file():
            found |= {str(root / line) for line in (root / name).read_text(encoding="utf-8").split()}
    return found
