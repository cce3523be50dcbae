"""The priors of a track's smoothers, from the record of its birth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.config.kernel_form import sensor_arrays
from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray, IntArray, RecordArray
from jeat_graph.filters.prior import write_prior, write_size_prior
from jeat_graph.smoothers.track_data import MOTION, Prior, TrackData


class ErrorStates(NamedTuple):
    """Which sensors' errors have a state of their own.

    Attributes:
        of_sensor: (S,) the sensor's error state, or -1.
        correlation_time: (B,) correlation time of each (s).
    """

    of_sensor: IntArray
    correlation_time: FloatArray

    @staticmethod
    def of(config: Config) -> ErrorStates:
        """Return those of a configuration, just as the filter has them."""
        arrays = sensor_arrays(config)
        return ErrorStates(arrays.error, arrays.correlation_time_s)


def prior_of(birth: np.void, errors: ErrorStates) -> Prior:
    """Return the prior of a track's state, as the filter began with it, from the record of its birth."""
    size = MOTION + len(errors.correlation_time)
    prior = Prior(float(birth["t"]), np.empty((2, size)), np.empty((2, size, size)))
    spread = birth["velocity_var"], birth["acceleration_var"]
    noise = birth["r"], birth["coloured_std"], birth["error"]
    write_prior(birth["z"], *noise, *spread, prior.mean, prior.cov)
    return prior


def size_prior_of(birth: np.void) -> Prior:
    """Return the prior of a track's size, (2, 2) and (2, 2, 2), from the record of its birth."""
    prior = Prior(float(birth["t"]), np.empty((2, 2)), np.empty((2, 2, 2)))
    write_size_prior(birth["log_size"], birth["size_var"], birth["rate_var"], prior.mean, prior.cov)
    return prior


def track_data(rows: RecordArray, errors: ErrorStates) -> TrackData:
    """Prior and measurements of a whole track from its records (M,), the birth first."""
    return TrackData.from_measurements(prior_of(rows[0], errors), rows[1:], errors.correlation_time)
