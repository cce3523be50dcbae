"""Truth that asks for far vehicles too, where they can be seen.

A truth ends at some distance, and what is farther is neither asked for nor wrong. A detector finds it all the
same, and one that was never shown where such boxes lie says them badly; a tracker then follows them. In our
simulated highways a third of all vehicles is so far away.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth

#: What simulated segments say of each vehicle beside their truth, and the columns that are used of it.
VEHICLES = "vehicles.csv"
_COLUMNS = ("t", "object_id", "visible", "contrast")
#: So much of a vehicle must be uncovered, and its contrast to what is around it so many times the noise
#: (Rose, "Vision: Human and Electronic", 1973): asked for vehicles that fog hides, a network sees vehicles
#: in the fog.
_LEAST_VISIBLE, _LEAST_CONTRAST = 0.3, 5.0
_US_PER_S = 1e6


def asking_for_far(truth: GroundTruth, folder: Path, least_px: float) -> GroundTruth:
    """Return truth that asks for ignored vehicles too, if they can be seen and are large enough.

    They can where a third of them is uncovered and stands out from what is around it.

    Args:
        truth: of a simulated segment.
        folder: the segment's.
        least_px: width and height that a box must have (px).

    Raises:
        DataError: nothing stands there of how much of each vehicle is to be seen, or not of all.
    """
    path = folder / VEHICLES
    try:
        table = pd.read_csv(path, usecols=list(_COLUMNS))
        visible = table["visible"].to_numpy(float) >= _LEAST_VISIBLE
        # Where no picture was drawn nobody knows the contrast.
        clear = ~(table["contrast"].to_numpy(float) < _LEAST_CONTRAST)
        keys = _keys(table["t"].to_numpy(float), table["object_id"].to_numpy(np.int64))
    except FileNotFoundError:
        raise DataError("is missing: without it nobody knows which far vehicles can be seen", path) from None
    except (ValueError, UnicodeDecodeError, pd.errors.ParserError):
        raise DataError(f"has no columns {', '.join(_COLUMNS)} of numbers", path) from None
    wanted = _keys(truth.t, truth.object_id)
    if not np.isin(wanted, keys).all():
        raise DataError("does not tell of the same vehicles as the truth beside it", path)
    order = np.argsort(keys)
    seen = (visible & clear)[order][np.searchsorted(keys[order], wanted)]
    large = (truth.boxes[:, 2:] >= least_px).all(axis=1)
    return replace(truth, ignore=truth.ignore & ~(seen & large))


def _keys(t: FloatArray, object_id: IntArray) -> npt.NDArray[np.complex128]:
    """Return one sortable value a vehicle and time: microseconds, then its number."""
    return np.asarray(np.rint(t * _US_PER_S) + 1j * object_id, dtype=np.complex128)
