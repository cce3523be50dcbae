"""Recordings of events with boxes as NumPy arrays beside them: Prophesee's Gen1 and 1 Megapixel, and eTraM.

A recording is `NAME_td.dat` (or `.h5`, `.raw`, …) and `NAME_bbox.npy`, anywhere below the set's folder;
folders that begin with `train`, `val` and `test` part it. Labels hold at their own times (`label_times`).

==========  ==================  ==========================================================================
set         picture             numbers of classes
==========  ==================  ==========================================================================
`gen1`      304 x 240 px        car, pedestrian
`1mpx`      1280 x 720 px       pedestrian, two wheeler, car, truck, bus, traffic sign, traffic light
`etram`     1280 x 720 px       pedestrian, car, bicycle, bus, motorbike, truck, tram, wheelchair
==========  ==================  ==========================================================================

Sources: de Tournemire et al., "A Large Scale Event-based Detection Dataset for Automotive" (2020); Perot et
al., "Learning to Detect Objects with a 1 Megapixel Event Camera" (2020); Verma et al., "eTraM: Event-based
Traffic Monitoring Dataset" (2024), and the class lists of their published tools.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.detection.models.class_names import wanted_classes
from jeat_graph.io.events.converting import convert
from jeat_graph.io.events.indexed import IndexedFile, open_indexed
from jeat_graph.io.events.opening import open_events
from jeat_graph.io.formats.prophesee import boxes_of, read_array, times_of
from jeat_graph_sehn.training.data_sets import EventSegment
from jeat_graph_sehn.training.label_times import LabelTimes
from jeat_graph_sehn.training.settings import LabelSettings

_BOXES, _PLAIN = "_bbox.npy", ".npy"
#: Endings of a recording's events, in the order in which they are looked for.
_EVENTS = (".dat", ".h5", ".dat.h5", ".hdf5", ".raw")
_MIDDLES = ("_td", "")
_PART = re.compile(r"^(train|val|test)")
#: How the name ends of what a recording was converted to.
_CONVERTED = re.compile(r"-[0-9a-f]{12}\.h5$")
_LABEL_MAP = "label_map_dictionary.json"
_CLASSES: dict[str, tuple[str, ...]] = {
    "gen1": ("car", "pedestrian"),
    "1mpx": ("pedestrian", "two wheeler", "car", "truck", "bus", "traffic sign", "traffic light"),
    "etram": ("pedestrian", "car", "bicycle", "bus", "motorbike", "truck", "tram", "wheelchair"),
}
_SIZES = {"gen1": (304, 240), "1mpx": (1280, 720), "etram": (1280, 720)}
#: May be a vehicle or not: a two-wheeler is a motorcycle or a bicycle, a tram is none of a road's.
_UNSURE = {"two wheeler", "tram"}
#: What the sets' own evaluation leaves out: times (s), diagonals and sides (px), of gen1 and of the others.
_SKIPPED_S, _LEAST_GEN1, _LEAST_OTHERS = 0.5, (30.0, 10.0), (60.0, 20.0)
#: Labels farther apart do not tell who moves (s).
_LONGEST_GAP_S = 0.25
_US = 1e6


@dataclass(frozen=True)
class LabelledSegment(EventSegment):
    """A recording of events with labels at times of their own.

    Attributes:
        size_px: width and height of the picture, where the file does not say.
    """

    size_px: tuple[int, int] | None = field(default=None, kw_only=True)

    def open(self) -> IndexedFile:
        """Open its events."""
        file = _opened(self.path)
        file.size_px = file.size_px or self.size_px
        return file


class _Recording(NamedTuple):
    labels: Path
    events: Path
    part: str


def holds_labels(root: Path) -> bool:
    """Whether a folder holds boxes as arrays beside their events."""
    return root.is_dir() and next(_recordings(root), None) is not None


def described_labels(root: Path) -> str:
    """Return a checksum (SHA-256) of all labels of a folder, and of which events belong to them."""
    found = hashlib.sha256()
    for one in _recordings(root):
        found.update(str(one.events.relative_to(root)).encode())
        found.update(one.labels.read_bytes())
    return found.hexdigest()


def read_labelled_segments(
    root: Path,
    settings: LabelSettings,
    cache: Path,
    on_read: Callable[[str], object] = lambda _: None,
) -> list[LabelledSegment]:
    """Return the recordings of a data set.

    Args:
        root: its folder.
        settings: how the labels are read.
        cache: folder for what can only be read from its beginning (RAW), and is converted once.
        on_read: called with what is being read, again and again.

    Raises:
        ConfigError: nobody says what the numbers of classes mean.
        DataError: labels or events that cannot be read, or do not belong together.
    """
    recordings = list(_recordings(root))
    found = []
    for k, one in enumerate(recordings):
        on_read(f"{root.name}: {k} of {len(recordings)} recordings, {one.events.name}")
        path = _searchable(one.events, cache, on_read)
        with _opened(path) as file:
            own = _set_of(settings, root, one.labels, file.size_px)
            size_px = file.size_px or own.size_px
            later_us, end_us = file.t_offset_us, file.duration_us
        truth = _truth(one.labels, own, settings, size_px, later_us / _US)
        if not len(truth.frame_times()):
            continue
        if truth.frame_times()[0] * _US > end_us:
            raise DataError(f"begins after the last event of {one.events.name}: it is of others", one.labels)
        if settings.moving_only and float(np.median(np.diff(truth.frame_times(), prepend=np.nan)[1:])) > (
            _LONGEST_GAP_S
        ):
            raise DataError("has labels too rare to tell who moves: leave labels.moving_only out", one.labels)
        boxes = LabelTimes(truth, settings.moving_only)
        found.append(LabelledSegment(str(one.events), root.name, path, boxes, part=one.part, size_px=size_px))
    if not found:
        raise DataError("holds no labels at all in its arrays of boxes", root)
    return found


def forget_converted(cache: Path) -> None:
    """Remove what recordings were converted to, and the folder if nothing else is in it."""
    for path in cache.glob("*.h5"):
        if _CONVERTED.search(path.name):
            path.unlink()
    with suppress(OSError):  # not there, or not empty
        cache.rmdir()


def _recordings(root: Path) -> Iterator[_Recording]:
    """Yield labels and events that have one name, in one folder or in different ones."""
    arrays = sorted(root.rglob(f"*{_PLAIN}"))
    if not arrays:
        return
    events: dict[str, list[Path]] = {}
    for path in sorted(path for path in root.rglob("*") if path.name.endswith(_EVENTS)):
        events.setdefault(path.name, []).append(path)
    for labels in arrays:
        name = labels.name.removesuffix(_BOXES).removesuffix(_PLAIN)
        names = [f"{name}{middle}{ending}" for middle in _MIDDLES for ending in _EVENTS]
        places = [path for one in names for path in events.get(one, ())]
        beside = [path for path in places if path.parent == labels.parent]
        if places:
            parts = labels.relative_to(root).parts[:-1]
            part = next((match[1] for text in parts if (match := _PART.match(text.lower()))), "")
            yield _Recording(labels, (beside or places)[0], part)


def _opened(path: Path) -> IndexedFile:
    file = open_indexed(path)
    if file is None:
        raise DataError("cannot be read from the middle", path)
    return file


def _searchable(path: Path, cache: Path, on_read: Callable[[str], object]) -> Path:
    """Return a file that can be read from the middle: this one, or what it is converted to."""
    file = open_indexed(path)
    if file is not None:
        file.close()
        return path
    stat = path.stat()
    mark = hashlib.sha256(f"{path.resolve()} {stat.st_size} {stat.st_mtime_ns}".encode()).hexdigest()[:12]
    made = cache / f"{path.name.partition('.')[0]}-{mark}.h5"
    if not made.is_file():
        cache.mkdir(parents=True, exist_ok=True)
        read = 0

        def count(events: int) -> None:
            nonlocal read
            read += events
            on_read(f"{path.name} is converted once, {read / 1e6:.0f} million events so far")

        with open_events(path) as reader:
            convert(reader, made, on_events=count)
    return made


class _LabelSet(NamedTuple):
    """Names of a data set's classes, its picture (px), and the least diagonal and side of its boxes (px)."""

    classes: Mapping[int, str]
    size_px: tuple[int, int] | None
    least_px: tuple[float, float]


def _set_of(settings: LabelSettings, root: Path, labels: Path, size_px: tuple[int, int] | None) -> _LabelSet:
    name = settings.classes
    if name == "auto" and size_px == _SIZES["gen1"]:
        name = "gen1"
    if name != "auto":
        least = _LEAST_GEN1 if name == "gen1" else _LEAST_OTHERS
        return _LabelSet(dict(enumerate(_CLASSES[name])), _SIZES[name], least)
    folders = [labels.parent, *labels.parent.parents]
    for folder in folders[: folders.index(root) + 2]:
        if (folder / _LABEL_MAP).is_file():
            return _LabelSet(_label_map(folder / _LABEL_MAP), None, _LEAST_OTHERS)
    raise ConfigError(
        f"labels.classes: nothing says what the classes of {labels} mean; say --set labels.classes=1mpx, "
        f"etram or gen1, or put {_LABEL_MAP} beside the labels"
    )


def _label_map(path: Path) -> dict[int, str]:
    try:
        tree = json.loads(path.read_text(encoding="utf-8"))
        return {int(number): str(name) for number, name in dict(tree).items()}
    except (OSError, ValueError, TypeError):
        raise DataError('must be an object of numbers and names, {"0": "pedestrian", …}', path) from None


def _truth(
    path: Path,
    own: _LabelSet,
    settings: LabelSettings,
    size_px: tuple[int, int] | None,
    later_s: float,
) -> GroundTruth:
    """Return the boxes of a recording; labels of what is no vehicle leave their times behind."""
    table = read_array(path)
    times = times_of(table) - later_s
    corners = _within(boxes_of(table), size_px)
    numbers = table.whole("class_id") if "class_id" in table else None
    if numbers is None:
        raise DataError("has no field class_id", path)
    unknown = set(numbers.tolist()) - set(own.classes)
    if unknown:
        raise DataError(f"has boxes of class {min(unknown)}, which has no name in this set", path)
    vehicles, unsure = _kept(own.classes)
    sides = corners[:, 2:]
    kept = np.isin(numbers, [*vehicles, *unsure]) & (sides > 0.0).all(axis=1)
    ignored = np.isin(numbers, list(unsure))
    frames = np.unique(times)
    if settings.usual_filter:
        kept &= times > _SKIPPED_S
        frames = frames[frames > _SKIPPED_S]
        ignored |= _small(sides, own.least_px)
    tracks: IntArray = table.whole("track_id") if "track_id" in table else np.arange(len(times))
    return GroundTruth(
        t=times[kept],
        object_id=tracks[kept],
        boxes=corners[kept],
        motion=None,
        ignore=ignored[kept],
        classes=None,
        distance=None,
        frames=frames,
    )


def _kept(classes: Mapping[int, str]) -> tuple[frozenset[int], frozenset[int]]:
    """Return the numbers of vehicles, and of what may be one."""
    vehicles, _ = wanted_classes((), len(classes), classes)
    unsure = frozenset(number for number, name in classes.items() if name.lower() in _UNSURE)
    return (frozenset(classes) if vehicles is None else vehicles) - unsure, unsure


def _within(boxes: FloatArray, size_px: tuple[int, int] | None) -> FloatArray:
    """Cut boxes (R, 4; left, top, width, height) at the picture's edges: labels reach beyond them."""
    if size_px is None:
        return boxes
    low = np.clip(boxes[:, :2], 0.0, size_px)
    high = np.clip(boxes[:, :2] + boxes[:, 2:], 0.0, size_px)
    return np.hstack([low, high - low])


def _small(sides: FloatArray, least_px: tuple[float, float]) -> BoolArray:
    """Whether a box (R, 2; width, height) is too small for the sets' own evaluation (R,)."""
    return np.asarray((np.hypot(sides[:, 0], sides[:, 1]) < least_px[0]) | (sides.min(axis=1) < least_px[1]))
