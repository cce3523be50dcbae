"""Write box arrays as the Prophesee and DSEC detection data sets have them (see `prophesee` for reading)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.io.files.atomic import atomic_path

# Field names and types of DSEC-Detection's `tracks.npy`.
BOX_DTYPE = np.dtype(
    [
        ("t", "<i8"),
        ("x", "<f4"),
        ("y", "<f4"),
        ("w", "<f4"),
        ("h", "<f4"),
        ("class_id", "u1"),
        ("class_confidence", "<f4"),
        ("track_id", "<u4"),
    ]
)


def write_array(
    path: str | Path, t_us: IntArray, boxes: FloatArray, class_id: IntArray, track_id: IntArray
) -> None:
    """Write boxes of truth, with confidence 1.

    Args:
        path: the file, `.npy`.
        t_us: (N,) time (µs).
        boxes: (N, 4) left, top, width, height (px).
        class_id: (N,) 0 to 255.
        track_id: (N,) not negative.
    """
    array: npt.NDArray[np.void] = np.zeros(len(t_us), dtype=BOX_DTYPE)
    array["t"] = t_us
    for k, name in enumerate(("x", "y", "w", "h")):
        array[name] = boxes[:, k]
    array["class_id"] = class_id
    array["class_confidence"] = 1.0
    array["track_id"] = track_id
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        np.save(file, array, allow_pickle=False)
