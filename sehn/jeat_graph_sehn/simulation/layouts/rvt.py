"""Writes a set as RVT's training reads it: histograms of events, and the boxes at the end of some.

::

    train/000000/                                  val/ and test/ likewise, one folder a segment
        event_representations_v2/stacked_histogram_dt=50_nbins=10/
            event_representations.h5               `data` (R, 20, H, W) uint8; of 1280 x 720 px the half,
                                                   by the name event_representations_ds2_nearest.h5
            timestamps_us.npy                      (R,) int64: where each window of 50 ms ends
            objframe_idx_2_repr_idx.npy            (F,) int64: which of them have boxes
        labels_v2/
            labels.npz                             `labels` (K,), `objframe_idx_2_label_idx` (F,)
            timestamps_us.npy                      (F,) int64

All frames with boxes have labels, not only ten a second. A segment without any box is left out.
Source: https://github.com/uzh-rpg/RVT (MIT): what `scripts/genx` writes and `data/genx_utils` reads.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import IntArray
from jeat_graph.io.events.dsec_hdf5 import EventFile
from jeat_graph_sehn.simulation.layouts.histograms import BINS, halved, stacked_histogram
from jeat_graph_sehn.simulation.layouts.rvt_labels import LARGE, rvt_boxes
from jeat_graph_sehn.simulation.layouts.sets import SetSegment

WINDOW_US = 50_000
_NAME = f"stacked_histogram_dt={WINDOW_US // 1000}_nbins={BINS}"


class Windows(NamedTuple):
    """When windows end.

    Attributes:
        ends_us: (R,) of all, ascending (µs).
        labelled: (F,) numbers of those that end at a frame with boxes.
    """

    ends_us: IntArray
    labelled: IntArray


def windows_for(frames_us: IntArray) -> Windows:
    """Lay windows end to end so that each frame is the end of one.

    Before the first frame there are as many whole windows as the recording has; between two frames they are
    spread evenly, about one window's length apart, and at least one a frame.

    Args:
        frames_us: (F,) times of frames with boxes, ascending, at least one.
    """
    first = int(frames_us[0])
    before = [first - k * WINDOW_US for k in range(first // WINDOW_US - 1, 0, -1)]
    ends, labelled = [*before, first], [len(before)]
    for start, end in zip(frames_us[:-1].tolist(), frames_us[1:].tolist(), strict=True):
        count = max(1, round((end - start) / WINDOW_US))
        ends += [start + (end - start) * k // count for k in range(1, count + 1)]
        labelled.append(len(ends) - 1)
    return Windows(np.array(ends, dtype=np.int64), np.array(labelled, dtype=np.int64))


def write_rvt(segment: SetSegment, size_px: tuple[int, int], out: Path) -> bool:
    """Write a segment below `out`; returns false, and writes nothing, if it has no boxes.

    Args:
        segment: which.
        size_px: width and height of the picture.
        out: the set's folder.

    Raises:
        DataError: events or boxes cannot be read.
    """
    boxes = rvt_boxes(segment.boxes(), size_px)
    if not len(boxes):
        return False
    frames_us, first = np.unique(boxes["t"], return_index=True)
    windows = windows_for(frames_us)
    folder = out / segment.split / segment.name
    labels, events = folder / "labels_v2", folder / "event_representations_v2" / _NAME
    labels.mkdir(parents=True)
    events.mkdir(parents=True)
    np.savez(labels / "labels.npz", labels=boxes, objframe_idx_2_label_idx=first.astype(np.int64))
    np.save(labels / "timestamps_us.npy", frames_us.astype(np.int64))
    np.save(events / "timestamps_us.npy", windows.ends_us)
    np.save(events / "objframe_idx_2_repr_idx.npy", windows.labelled)
    half = size_px == LARGE
    _write_histograms(
        segment,
        size_px,
        windows.ends_us,
        events / f"event_representations{'_ds2_nearest' if half else ''}.h5",
    )
    return True


def _write_histograms(segment: SetSegment, size_px: tuple[int, int], ends_us: IntArray, path: Path) -> None:
    import h5py

    half = size_px == LARGE
    width, height = (side // 2 for side in size_px) if half else size_px
    shape = (2 * BINS, height, width)
    with EventFile(segment.events) as file, h5py.File(path, "w", libver="earliest") as out:
        data = out.create_dataset(
            "data",
            shape=(len(ends_us), *shape),
            maxshape=(None, *shape),
            chunks=(1, *shape),
            dtype=np.uint8,
            compression="gzip",
            compression_opts=1,
            track_times=False,
        )
        for k, end in enumerate(ends_us.tolist()):
            # Both ends belong to the window.
            counts: npt.NDArray[np.uint8] = stacked_histogram(file.between(end - WINDOW_US, end + 1), size_px)
            data[k] = halved(counts) if half else counts
