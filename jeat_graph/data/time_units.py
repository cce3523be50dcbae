"""Units of time: recordings carry seconds, but loggers write ms, µs or ns."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import ConfigError

#: How many of each make a second.
TIME_UNITS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}


def in_seconds(times: FloatArray, unit: str) -> FloatArray:
    """Return times (N,) of a unit in seconds; those in seconds as they are, to the last bit.

    Raises:
        ConfigError: a unit that is not known.
    """
    if unit not in TIME_UNITS:
        raise ConfigError(f"unknown unit of time {unit!r}; known: {', '.join(TIME_UNITS)}")
    # Divided, not multiplied: 1e-3 is no binary number, 1e3 is.
    return times if unit == "s" else np.asarray(times / TIME_UNITS[unit])
