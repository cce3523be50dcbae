"""Units of time: recordings carry seconds, but loggers write ms, µs or ns."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import ConfigError

#: How many of each make a second.
TIME_UNITS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
#: No sensor that vehicles are tracked with takes longer than this from scan to scan (s).
LONGEST_STEP_S = 5.0
#: Nor less than this: the fastest cameras give a tenth of so many boxes.
SHORTEST_STEP_S = 1e-4
# Steps of a camera, from 2 kHz to 1 Hz (s): the unit that brings a step here is the likely one.
_USUAL_STEP_S = (0.0005, 1.0)


def in_seconds(times: FloatArray, unit: str) -> FloatArray:
    """Return times (N,) of a unit in seconds; those in seconds as they are, to the last bit.

    Raises:
        ConfigError: a unit that is not known.
    """
    if unit not in TIME_UNITS:
        raise ConfigError(f"unknown unit of time {unit!r}; known: {', '.join(TIME_UNITS)}")
    # Divided, not multiplied: 1e-3 is no binary number, 1e3 is.
    return times if unit == "s" else np.asarray(times / TIME_UNITS[unit])


def likely_unit(step: float) -> str | None:
    """Return the unit in which a step from scan to scan is a usual one, or None where seconds will do.

    Args:
        step: median step between scans of one sensor, as if it were seconds.
    """
    if step < LONGEST_STEP_S:
        return None
    low, high = _USUAL_STEP_S
    fitting = [unit for unit, size in TIME_UNITS.items() if unit != "s" and low <= step / size <= high]
    return fitting[0] if fitting else None


def unit_question(step: float) -> str:
    """Say that a step is too long or too short, and which unit of time is likely; else empty.

    Args:
        step: as `likely_unit`; 0 where it is not known.
    """
    if 0.0 < step < SHORTEST_STEP_S:
        low, high = _USUAL_STEP_S
        factors = [size for size in TIME_UNITS.values() if low <= step * size <= high]
        guess = f", and {factors[0]:.0f} times as long a usual one" if factors else ""
        return f"median step {step:.6g} s, too short for a camera{guess}: is --time-unit the right one?"
    if step < LONGEST_STEP_S:
        return ""
    unit = likely_unit(step)
    guess = f"are the times in {unit}? (--time-unit {unit})" if unit else "are the times in seconds?"
    return f"median step {step:.6g} s: {guess}"
