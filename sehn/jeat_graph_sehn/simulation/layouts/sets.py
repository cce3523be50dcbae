"""What there is to be written in other layouts: the segments of a simulated set of pictures and events."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.io.events.dsec_hdf5 import EventFile
from jeat_graph.io.exports.prophesee_writer import BOX_DTYPE
from jeat_graph.io.media.video import FRAME_TIMES, read_frame_times
from jeat_graph_sehn.simulation.dataset.layout import BOXES, EVENTS, MANIFEST, SEGMENTS
from jeat_graph_sehn.simulation.dataset.manifest import read_json
from jeat_graph_sehn.simulation.dataset.protocol import SPLITS
from jeat_graph_sehn.simulation.world.vehicles import KIND_NAMES

#: Kinds of vehicles with two wheels; all others count as cars where a layout knows no better.
_TWO_WHEELS = ("motorcycle",)


class SetSegment(NamedTuple):
    """One segment of a set.

    Attributes:
        name: of its folder.
        split: train, val or test.
        folder: where it is.
    """

    name: str
    split: str
    folder: Path

    @property
    def events(self) -> Path:
        """Its file of events."""
        return self.folder / EVENTS

    def times_us(self) -> IntArray:
        """Times of its frames (F,) in µs."""
        return read_frame_times(self.folder / FRAME_TIMES)

    def boxes(self) -> npt.NDArray[np.void]:
        """Boxes that are asked for, with the fields of `BOX_DTYPE`, by time; kinds are `KIND_NAMES`.

        Raises:
            DataError: they cannot be read, or are not as `simulate` writes them.
        """
        path = self.folder / BOXES
        try:
            array = np.load(path, allow_pickle=False)
        except (OSError, ValueError, EOFError) as error:
            raise DataError(f"cannot be read: {error}", path) from None
        if array.dtype != BOX_DTYPE:
            raise DataError("is not as `simulate` writes it", path)
        return np.asarray(array)


class SimulatedSet(NamedTuple):
    """A set that is whole.

    Attributes:
        root: its folder.
        size_px: width and height of pictures and events.
        segments: in their order.
    """

    root: Path
    size_px: tuple[int, int]
    segments: list[SetSegment]


def open_set(root: str | Path) -> SimulatedSet:
    """Read what a folder holds that `simulate --sensors pictures` wrote.

    Raises:
        DataError: it holds no whole set, or one without events.
    """
    folder = Path(root)
    if not (folder / MANIFEST).is_file():
        raise DataError(
            "holds no simulated pictures and events that are whole (no manifest.json); make them with "
            "`simulate --sensors pictures`",
            folder,
        )
    splits = read_json(folder / MANIFEST).get("splits")
    if not isinstance(splits, dict):
        raise DataError("lacks 'splits': is it of `simulate --sensors pictures`?", folder / MANIFEST)
    segments = [
        SetSegment(str(name), split, folder / SEGMENTS / str(name))
        for split in SPLITS
        for name in splits.get(split, [])
    ]
    for segment in segments:
        if not segment.events.is_file():
            raise DataError("no such file", segment.events)
    if not segments:
        raise DataError("has no segments", folder / MANIFEST)
    with EventFile(segments[0].events) as file:
        size_px = file.size_px
    if size_px is None:
        raise DataError("does not say how large its picture is", segments[0].events)
    return SimulatedSet(folder, size_px, sorted(segments))


def two_wheels(kind: IntArray) -> npt.NDArray[np.bool_]:
    """Return which of the kinds, (N,) indices into `KIND_NAMES`, have two wheels."""
    return np.asarray(np.isin(KIND_NAMES[kind], _TWO_WHEELS))
