"""What the filter took in during one step, for whoever wants the measurements of each track: the smoothers.

The log is a preallocated table that compiled kernels fill. One of capacity 0 takes nothing and costs nothing,
and no kernel ever reads it: the causal estimates are the same with and without it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray

#: Columns of `UpdateLog.rows`. `R_x, R_y` are the variances of the white noise exactly as the filter used
#: them, scale and weight included, `lever_x, lever_y` the levers of the sensor's error state; `jerk` is the
#: root spectral density of the track's jerk at the time of the update; `birth` is 1 where the measurement
#: started the track, and then `var_v_x` … `var_rate` are the other prior variances; `nis` is the normalised
#: innovation squared of the centre (NaN at a birth) and `scale` the noise scale s that went into the noise.
COLUMNS = (
    "track_id",
    "sensor",
    "z_x",
    "z_y",
    "R_x",
    "R_y",
    "jerk",
    "log_width",
    "log_height",
    "var_log_width",
    "var_log_height",
    "birth",
    "var_v_x",
    "var_v_y",
    "var_a_x",
    "var_a_y",
    "var_rate",
    "nis",
    "scale",
    "lever_x",
    "lever_y",
)
WIDTH = len(COLUMNS)


class UpdateLog(NamedTuple):
    """The measurements that the last step gave to tracks.

    Attributes:
        rows: (C, `WIDTH`) one measurement a row; C is at least the number of detections of the step, or 0.
        count: (1,) rows in use.
    """

    rows: FloatArray
    count: IntArray  # type: ignore[assignment]  # hides tuple.count, which nobody calls


def allocate_log(capacity: int) -> UpdateLog:
    """Allocate a log for steps of at most `capacity` detections; 0 for a log that takes nothing."""
    return UpdateLog(np.zeros((capacity, WIDTH)), np.zeros(1, dtype=np.int64))


@njit(cache=True)
def log_update(
    log: UpdateLog,
    track_id: int,
    sensor: int,
    z: FloatArray,
    R: FloatArray,
    lever: FloatArray,
    jerk: float,
    log_size: FloatArray,
    size_var: FloatArray,
) -> None:
    """Append one measurement, if there is room.

    Args:
        log: the log.
        track_id: the track that took it.
        sensor: index of the sensor.
        z: (2,) centre (px).
        R: (2,) variances of its white noise (px²).
        lever: (2,) levers of the sensor's error state (px), 0 where it has none.
        jerk: root spectral density of the track's jerk (px/s^2.5).
        log_size: (2,) ln width, ln height.
        size_var: (2,) their variances.
    """
    k = log.count[0]
    if k >= len(log.rows):
        return
    row = log.rows[k]
    row[0] = track_id
    row[1] = sensor
    for axis in range(2):
        row[2 + axis] = z[axis]
        row[4 + axis] = R[axis]
        row[7 + axis] = log_size[axis]
        row[9 + axis] = size_var[axis]
    row[6] = jerk
    row[11:] = 0.0
    row[17] = math.nan
    row[18] = 1.0
    for axis in range(2):
        row[19 + axis] = lever[axis]
    log.count[0] = k + 1


@njit(cache=True)
def log_surprise(log: UpdateLog, nis: float, scale: float) -> None:
    """Note in the last row how well the measurement fitted the prediction.

    Args:
        log: the log, of capacity 0 or with a row just appended.
        nis: normalised innovation squared (χ² with 2 degrees of freedom).
        scale: the noise scale s with which the measurement was weighed.
    """
    k = log.count[0] - 1
    if k < 0:
        return
    log.rows[k, 17] = nis
    log.rows[k, 18] = scale


@njit(cache=True)
def log_birth(log: UpdateLog, cov: FloatArray, size_cov: FloatArray) -> None:
    """Mark the last row as a birth and note the prior of the new track.

    Args:
        log: the log.
        cov: (2, 3 + B, 3 + B) covariance of the new track.
        size_cov: (2, 2, 2) covariance of its size.
    """
    k = log.count[0] - 1
    if k < 0:
        return
    row = log.rows[k]
    row[11] = 1.0
    for axis in range(2):
        row[12 + axis] = cov[axis, 1, 1]
        row[14 + axis] = cov[axis, 2, 2]
    row[16] = size_cov[0, 1, 1]
