"""Records of one track's measurements: made, checked, put in order of time and grouped by time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray, RecordArray
from jeat_graph.data.errors import DataError
from jeat_graph.filters.measurement import MEASUREMENT

#: Measurements closer than this (s) share one state. Within a microsecond nothing on a road moves,
#: while the process noise of such a step, of order Δ⁵, would only spoil the arithmetic.
COINCIDENT_S = 1e-6

_BYTES = np.dtype((np.void, MEASUREMENT.itemsize))


def measurements(
    t: npt.ArrayLike,
    z: npt.ArrayLike,
    r: npt.ArrayLike,
    jerk: npt.ArrayLike,
    coloured_std: npt.ArrayLike | None = None,
    error: npt.ArrayLike | None = None,
) -> RecordArray:
    """Make records of measurements z = p + h e + w of one track, where no filter has written them down.

    A coloured error has an error state: e is an error state of unit variance
    (`track_data.TrackData`), h its standard deviation in the measurement, and w white.

    Args:
        t: (M,) times (s).
        z: (M, 2) centres (px).
        r: (M, 2) variances of the white part w (px²).
        jerk: (M,) root spectral densities of the jerk since the measurement before (px/s^2.5).
        coloured_std: (M, 2) standard deviations h of the coloured part (px); None for none at all.
        error: (M,) index of its error state e, or -1; None for -1.

    Returns:
        (M,) records (`filters.measurement.MEASUREMENT`); what they say of sizes and births is zero.

    Raises:
        DataError: wrong shapes.
    """
    times = np.asarray(t, dtype=np.float64)
    out = np.zeros(times.size, dtype=MEASUREMENT)
    none = coloured_std is None or error is None
    columns = {
        "t": times,
        "z": z,
        "r": r,
        "jerk": jerk,
        "coloured_std": np.zeros((times.size, 2)) if none else coloured_std,
        "error": np.full(times.size, -1) if none else error,
    }
    for name, column in columns.items():
        values = np.asarray(column)
        if values.shape != out[name].shape:
            raise DataError(f"{name} must have shape {out[name].shape}, not {values.shape}")
        out[name] = values
    return out


def concatenate_measurements(parts: Sequence[RecordArray]) -> RecordArray:
    """Join records (`MEASUREMENT`), as bytes, since NumPy would compare all fields."""
    if len(parts) == 1:
        return parts[0]
    if not parts:
        return np.zeros(0, dtype=MEASUREMENT)
    return np.concatenate([part.view(_BYTES) for part in parts]).view(MEASUREMENT)


def by_time(measured: RecordArray) -> RecordArray:
    """Return records in order of time; those at one time stay in order."""
    t = measured["t"]
    return measured if np.all(t[1:] >= t[:-1]) else measured[np.argsort(t, kind="stable")]


def check_measurements(measured: RecordArray, errors: int) -> None:
    """See to it that records are fit for a smoother with so many error states.

    Raises:
        DataError: records of another kind, numbers that are not finite, variances or densities <= 0, indices
            out of range.
    """
    if measured.dtype != MEASUREMENT or measured.ndim != 1:
        raise DataError("a smoother takes measurements as an array of records, see `measurements`")
    if not _all_valid(measured, errors):
        raise DataError(
            "measurements must be finite, their variances and spectral densities positive, and their error "
            f"states numbered from 0 to {errors - 1}, or -1"
        )


@njit(cache=True)
def _all_valid(measured: RecordArray, errors: int) -> bool:
    """Whether all is finite and in range; compiled, as live callers feed one row at a time."""
    for i in range(len(measured)):
        one = measured[i]
        if not (np.isfinite(one["t"]) and np.isfinite(one["jerk"]) and one["jerk"] > 0.0):
            return False
        if one["error"] < -1 or one["error"] >= errors:
            return False
        for axis in range(2):
            if not (np.isfinite(one["z"][axis]) and np.isfinite(one["r"][axis]) and one["r"][axis] > 0.0):
                return False
            if not np.isfinite(one["coloured_std"][axis]):
                return False
    return True


def group_times(times: FloatArray, latest: float) -> tuple[IntArray, IntArray]:
    """Assign ascending times to keys, coincident ones to the same key.

    A key takes the time of its first measurement, so a chain of close stamps does not drift.

    Args:
        times: (M,) ascending times (s).
        latest: time of the key before, key 0 (s).

    Returns:
        (M,) the key of each time, counted from key 0, and (J,) index of each new key's first time.
    """
    key = np.empty(len(times), dtype=np.int64)
    first = np.empty(len(times), dtype=np.int64)
    return key, first[: _group(times, latest, key, first)]


@njit(cache=True)
def _group(times: FloatArray, latest: float, key: IntArray, first: IntArray) -> int:
    """Fill `key` and `first` as `group_times` says; return the number of new keys."""
    count = 0
    for i in range(len(times)):
        if times[i] - latest > COINCIDENT_S:
            first[count] = i
            latest = times[i]
            count += 1
        key[i] = count
    return count
