"""Which unit of time a recording is most likely in: nobody scans once in 50 s, but many every 50 ms."""

from __future__ import annotations

from jeat_graph.data.time_units import TIME_UNITS

#: No sensor that vehicles are tracked with takes longer than this from scan to scan (s).
LONGEST_STEP_S = 5.0
#: Nor less than this: the fastest cameras give a tenth of so many boxes.
SHORTEST_STEP_S = 1e-4
# Steps of a camera, from 2 kHz to 1 Hz (s): the unit that brings a step here is the likely one.
_USUAL_STEP_S = (0.0005, 1.0)


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
    guess = "are the times in seconds?"
    if unit:
        python = f"in Python time_unit={unit!r}"
        guess = f"are the times in {unit}? (--time-unit {unit}; {python})"
    return f"median step {step:.6g} s: {guess}"
