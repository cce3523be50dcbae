"""The measurements that tracks took in during one step, for the smoothers and the diagnostics.

The log is a preallocated array of records that compiled kernels fill. One of capacity 0 takes nothing and
costs nothing, and no kernel ever reads it: the causal estimates are the same with and without it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.config.kernel_form import SensorArrays
from jeat_graph.data.arrays import FloatArray, IntArray, RecordArray
from jeat_graph.data.lent import lent
from jeat_graph.filters.measurement import MEASUREMENT
from jeat_graph.tracking.batch import Batch, Measured

# A configuration may ask for no jerk at all; the smoothers want process noise that can be inverted.
_LEAST_JERK = 1e-6


@lent
class UpdateLog(NamedTuple):
    """The measurements that the last step gave to tracks.

    Attributes:
        rows: (C,) records (`MEASUREMENT`); C is at least the number of detections of the step, or 0.
        detection: (C,) which detection of the step each is.
        count: (1,) rows in use.
    """

    rows: RecordArray
    detection: IntArray
    count: IntArray  # type: ignore[assignment]  # hides tuple.count, which nobody calls


def allocate_log(capacity: int) -> UpdateLog:
    """Allocate a log for steps of at most `capacity` detections; 0 for a log that takes nothing."""
    index = np.zeros(capacity, dtype=np.int64)
    return UpdateLog(np.zeros(capacity, dtype=MEASUREMENT), index, np.zeros(1, dtype=np.int64))


@njit(cache=True)
def log_updates(
    log: UpdateLog,
    track_id: IntArray,
    jerk: FloatArray,
    size_density: FloatArray,
    batch: Batch,
    measured: Measured,
    sensors: SensorArrays,
) -> None:
    """Append K measurements, as far as there is room.

    Args:
        log: the log.
        track_id: (C,) identities of all tracks.
        jerk: (K,) root spectral density of each taking track's jerk (px/s^2.5).
        size_density: (K,) that of the rate of its ln size (1/s^1.5).
        batch: all detections of the step.
        measured: what the taken ones measure of their tracks.
        sensors: parameters of the sensors.
    """
    first = log.count[0]
    num = min(len(measured.track), len(log.rows) - first)
    rows, taken, z, white, noise = log.rows, measured.detection, measured.z, measured.white, measured.noise
    coloured_std, log_size, size_var = measured.coloured_std, measured.log_size, measured.log_size_var
    for k in range(num):
        row, j = rows[first + k], taken[k]
        log.detection[first + k] = j
        row["t"] = batch.t
        row["track_id"] = track_id[measured.track[k]]
        row["sensor"] = batch.sensor[j]
        row["birth"] = 0
        row["error"] = sensors.error[batch.sensor[j]]
        row["jerk"] = max(jerk[k], _LEAST_JERK)
        row["size_density"] = size_density[k]
        row["rate_var"] = 0.0
        row["nis"] = math.nan
        row["scale"] = 1.0
        for axis in range(2):
            row["z"][axis] = z[k, axis]
            row["r"][axis] = white[k, axis]
            row["noise"][axis] = noise[k, axis]
            row["coloured_std"][axis] = coloured_std[k, axis]
            row["log_size"][axis] = log_size[k, axis]
            row["size_var"][axis] = size_var[k, axis]
            row["cut"][axis] = batch.cut[j, axis]
            row["side"][axis] = batch.side[j, axis]
            row["velocity_var"][axis] = 0.0
            row["acceleration_var"][axis] = 0.0
    log.count[0] = first + num


@njit(cache=True)
def log_innovations(log: UpdateLog, nis: FloatArray, scale: FloatArray) -> None:
    """Note in the last K rows how well the measurements fitted the predictions.

    Args:
        log: the log, of capacity 0 or with K rows just appended.
        nis: (K,) normalised innovation squared (χ² with 2 degrees of freedom).
        scale: (K,) the noise scale s with which each measurement was weighed.
    """
    if len(log.rows) == 0:
        return
    first = log.count[0] - len(nis)
    for k in range(len(nis)):
        log.rows[first + k]["nis"] = nis[k]
        log.rows[first + k]["scale"] = scale[k]


@njit(cache=True)
def log_birth(
    log: UpdateLog, velocity_var: FloatArray, acceleration_var: FloatArray, rate_var: float
) -> None:
    """Mark the last row as a birth, and note the variances that its prior adds (`filters/prior.py`).

    Args:
        log: the log.
        velocity_var: (2,) of the velocity (px²/s²).
        acceleration_var: (2,) of the acceleration (px²/s⁴).
        rate_var: of the rate of ln width and ln height (1/s²).
    """
    k = log.count[0] - 1
    if k < 0:
        return
    row = log.rows[k]
    row["birth"] = 1
    row["rate_var"] = rate_var
    for axis in range(2):
        row["velocity_var"][axis] = velocity_var[axis]
        row["acceleration_var"][axis] = acceleration_var[axis]
