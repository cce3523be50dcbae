"""From what the update log says of a track to the prior and the measurements of its smoothers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.config.kernel_form import sensor_arrays
from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.smoothers.track_data import TrackData
from jeat_graph.tracking.update_log import COLUMNS

#: Columns of a measurement here: its time, then those of the update log.
COLUMN = {name: 1 + k for k, name in enumerate(COLUMNS)} | {"t": 0}

_MOTION = 3
_Z, _R = slice(COLUMN["z_x"], COLUMN["z_y"] + 1), slice(COLUMN["R_x"], COLUMN["R_y"] + 1)
_LEVER = slice(COLUMN["lever_x"], COLUMN["lever_y"] + 1)
_SIZE = slice(COLUMN["log_width"], COLUMN["log_height"] + 1)
_SIZE_VAR = slice(COLUMN["var_log_width"], COLUMN["var_log_height"] + 1)

# A configuration may ask for no jerk at all; the smoothers want process noise that can be inverted.
_LEAST_JERK = 1e-6


class ErrorStates(NamedTuple):
    """Which sensors' errors have a state of their own.

    Attributes:
        of_sensor: (S,) the sensor's error state, or -1.
        memory: (B,) correlation time of each (s).
    """

    of_sensor: IntArray
    memory: FloatArray

    @staticmethod
    def of(config: Config) -> ErrorStates:
        """Return those of a configuration, just as the filter has them."""
        arrays = sensor_arrays(config)
        return ErrorStates(arrays.error, arrays.correlation_time_s)


def prior_of(birth: FloatArray, errors: ErrorStates) -> tuple[float, FloatArray, FloatArray]:
    """Prior of a track's state from its birth (1 + WIDTH,), as the filter begins.

    Returns:
        Time (s), mean (2, 3 + B), covariance (2, 3 + B, 3 + B).
    """
    D = _MOTION + len(errors.memory)
    mean, cov = np.zeros((2, D)), np.zeros((2, D, D))
    cov[:, range(_MOTION, D), range(_MOTION, D)] = 1.0
    error = errors.of_sensor[int(birth[COLUMN["sensor"]])]
    lever = birth[_LEVER]
    for axis, name in enumerate("xy"):
        mean[axis, 0] = birth[_Z][axis]
        cov[axis, 0, 0] = birth[_R][axis] + lever[axis] ** 2
        cov[axis, 1, 1] = birth[COLUMN[f"var_v_{name}"]]
        cov[axis, 2, 2] = birth[COLUMN[f"var_a_{name}"]]
        if error >= 0:
            cov[axis, 0, _MOTION + error] = cov[axis, _MOTION + error, 0] = -lever[axis]
    return float(birth[0]), mean, cov


def size_prior_of(birth: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """Prior of a track's size: time (s), mean (2, 2), covariance (2, 2, 2), from its birth (1 + WIDTH,)."""
    mean = np.zeros((2, 2))
    mean[:, 0] = birth[_SIZE]
    cov = np.zeros((2, 2, 2))
    cov[:, 0, 0] = birth[_SIZE_VAR]
    cov[:, 1, 1] = birth[COLUMN["var_rate"]]
    return float(birth[0]), mean, cov


def measurements_of(
    rows: FloatArray, errors: ErrorStates
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, IntArray]:
    """Measurements as smoothers take them, from rows (M, 1 + WIDTH).

    Returns:
        t (M,), z (M, 2), r (M, 2), q (M,), lever (M, 2), error (M,); see `smoothers.engine`.
    """
    error = errors.of_sensor[rows[:, COLUMN["sensor"]].astype(np.int64)]
    jerk = np.maximum(rows[:, COLUMN["jerk"]], _LEAST_JERK)
    return rows[:, 0], rows[:, _Z], rows[:, _R], jerk, rows[:, _LEVER], error


def sizes_of(rows: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Times (M,), ln width and ln height (M, 2) and their variances (M, 2), from rows (M, 1 + WIDTH)."""
    return rows[:, 0], rows[:, _SIZE], rows[:, _SIZE_VAR]


def track_data(rows: FloatArray, errors: ErrorStates) -> TrackData:
    """Prior and measurements of a whole track from its rows (M, 1 + WIDTH), the birth first."""
    t, z, r, q, lever, error = measurements_of(rows[1:], errors)
    return TrackData.from_measurements(
        *prior_of(rows[0], errors), t, z, r, q, lever=lever, error=error, memory=errors.memory
    )
