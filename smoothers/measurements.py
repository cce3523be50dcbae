"""Measurements of one track on their way into a smoother: checked, in order of time, gathered by key."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.errors import DataError

#: Measurements closer than this (s) share one state. Within a microsecond nothing on a road moves,
#: while the process noise of such a step, of order Δ⁵, would only spoil the arithmetic.
COINCIDENT_S = 1e-6


class Measurements(NamedTuple):
    """Measurements z = p + h e + w of one track, with the jerk since the one before.

    The error of a sensor has a memory if it is said to be coloured: e is an error state of unit variance
    (`track_data.TrackData`), h its lever, and w white.

    Attributes:
        t: (M,) times (s).
        z: (M, 2) measured centres (px).
        r: (M, 2) variances of the white part w (px²).
        q: (M,) root spectral density of the jerk since the measurement before (px/s^2.5).
        lever: (M, 2) standard deviation h of the part with a memory (px), 0 for white errors.
        error: (M,) index of the error state e, or -1.
    """

    t: FloatArray
    z: FloatArray
    r: FloatArray
    q: FloatArray
    lever: FloatArray
    error: IntArray

    def take(self, rows: IntArray | BoolArray) -> Measurements:
        """Return some of them."""
        t, z, r, q, lever, error = self
        return Measurements(t[rows], z[rows], r[rows], q[rows], lever[rows], error[rows])

    def by_time(self) -> Measurements:
        """Return them in order of time; those at one time stay in order."""
        if np.all(self.t[1:] >= self.t[:-1]):
            return self
        return self.take(np.argsort(self.t, kind="stable"))

    @staticmethod
    def concatenate(parts: Sequence[Measurements]) -> Measurements:
        """Join them."""
        if len(parts) == 1:
            return parts[0]
        return Measurements(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def check_measurements(
    t: npt.ArrayLike,
    z: npt.ArrayLike,
    r: npt.ArrayLike,
    q: npt.ArrayLike,
    lever: npt.ArrayLike | None = None,
    error: npt.ArrayLike | None = None,
    errors: int = 0,
) -> Measurements:
    """Convert and check measurements of one track.

    Args:
        t: (M,) times (s).
        z: (M, 2) centres (px).
        r: (M, 2) variances of the white part (px²).
        q: (M,) root spectral densities of the jerk (px/s^2.5).
        lever: (M, 2) standard deviations of the part with a memory (px); None for none at all.
        error: (M,) index of its error state, or -1; None for -1.
        errors: number of error states.

    Returns:
        The measurements, as float64 and int64 arrays.

    Raises:
        DataError: wrong shapes, numbers that are not finite, variances or densities <= 0, indices out of
            range.
    """
    times = np.asarray(t, dtype=np.float64)
    centres, variances = np.asarray(z, dtype=np.float64), np.asarray(r, dtype=np.float64)
    density = np.asarray(q, dtype=np.float64)
    rows = times.size
    if lever is None or error is None:
        levers, states = np.zeros((rows, 2)), np.full(rows, -1, dtype=np.int64)
    else:
        levers, states = np.asarray(lever, dtype=np.float64), np.asarray(error, dtype=np.int64)
    if times.shape != (rows,) or density.shape != (rows,) or states.shape != (rows,):
        raise DataError(f"times, densities and indices of error states must have shape ({rows},)")
    if centres.shape != (rows, 2) or variances.shape != (rows, 2) or levers.shape != (rows, 2):
        raise DataError(f"centres, variances and levers must have shape ({rows}, 2)")
    if not _all_valid(times, centres, variances, density, levers, states, errors):
        raise DataError(
            "measurements must be finite, their variances and spectral densities positive, and their error "
            f"states numbered from 0 to {errors - 1}, or -1"
        )
    return Measurements(times, centres, variances, density, levers, states)


@njit(cache=True)
def _all_valid(
    t: FloatArray,
    z: FloatArray,
    r: FloatArray,
    q: FloatArray,
    lever: FloatArray,
    error: IntArray,
    errors: int,
) -> bool:
    """Whether all is finite and in range; compiled, as live callers feed one row at a time."""
    for i in range(len(t)):
        if not (np.isfinite(t[i]) and np.isfinite(q[i]) and q[i] > 0.0):
            return False
        if error[i] < -1 or error[i] >= errors:
            return False
        for axis in range(2):
            if not (np.isfinite(z[i, axis]) and np.isfinite(r[i, axis]) and r[i, axis] > 0.0):
                return False
            if not np.isfinite(lever[i, axis]):
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
