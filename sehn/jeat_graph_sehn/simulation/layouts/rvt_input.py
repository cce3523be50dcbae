"""Writes a set as RVT's own preprocessing reads it: files of events and of boxes by their names.

::

    train/000000_td.h5          events; of 304 x 240 px under the name 000000_td.dat.h5
    train/000000_bbox.npy       boxes, with the fields of Prophesee's data sets
    val/, test/                 likewise

It takes two sizes of pictures only; of 1280 x 720 it wants boxes at 30 or 60 Hz.
Source: https://github.com/uzh-rpg/RVT (MIT), `scripts/genx/preprocess_dataset.py`.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np

from jeat_graph.data.arrays import IntArray
from jeat_graph.data.errors import DataError
from jeat_graph_sehn.simulation.layouts.rvt_labels import LARGE, SMALL, rvt_classes
from jeat_graph_sehn.simulation.layouts.sets import SetSegment

_RATES_HZ = (30, 60)  # of boxes in Prophesee's 1 Mpx data set
_FROM_US = 100_000  # boxes before are not taken


def write_rvt_input(segment: SetSegment, size_px: tuple[int, int], out: Path) -> bool:
    """Write a segment below `out`; returns false, and writes nothing, if it has no boxes after .1 s.

    Args:
        segment: which.
        size_px: width and height of the picture.
        out: the set's folder.

    Raises:
        DataError: a size or a rate that RVT's preprocessing does not take, or files that cannot be read.
    """
    if size_px not in (LARGE, SMALL):
        raise DataError(
            f"is of {size_px[0]} x {size_px[1]} px, and RVT's preprocessing takes 1280 x 720 and 304 x 240 "
            "only; make the set with --size 1280x720, or write what it would have made with --to rvt",
            segment.events,
        )
    boxes = rvt_classes(segment.boxes(), size_px)
    times = np.unique(boxes["t"])
    if not len(times) or times[-1] < _FROM_US:
        return False
    if size_px == LARGE:
        _check_rate(times, segment)
    folder = out / segment.split
    folder.mkdir(parents=True, exist_ok=True)
    np.save(folder / f"{segment.name}_bbox.npy", boxes)
    shutil.copyfile(segment.events, folder / f"{segment.name}_td{'.dat' if size_px == SMALL else ''}.h5")
    return True


def _check_rate(times_us: IntArray, segment: SetSegment) -> None:
    rate = round(1e6 / float(np.median(np.diff(times_us)))) if len(times_us) > 1 else 0
    if rate not in _RATES_HZ:
        raise DataError(
            f"has boxes at {rate} Hz, and RVT's preprocessing takes 30 and 60 Hz of pictures of this "
            "size; make the set with `rgb: {rate_hz: 30}` in a file for --imaging, or write what it would "
            "have made with --to rvt",
            segment.folder,
        )
