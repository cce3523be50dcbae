"""Indicators: which side of a vehicle blinks, and when.

Who changes lane signals to that side for two seconds before and until the change is half done (German road
law asks for it, and most do).
"""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph_sehn.simulation.world.paths import Paths

LEAD_S = 2.0  # before the change begins
_UNTIL = 0.5  # of the change
_RISE_S = 0.03  # of a lamp, an LED's driver and a filament between them
_OBEY = 0.85  # share of changes that are signalled
_GOLDEN = 0.6180339887  # spreads whole numbers evenly over [0, 1)


def turning(paths: Paths, facing: FloatArray, times: FloatArray) -> BoolArray:
    """Say which of V driving vehicles signals a change of lane at times (T,) (s), to its left and right.

    Args:
        paths: of the vehicles.
        facing: (V,) +1 where the vehicle's right is the road's positive x, else -1.
        times: (T,) s.

    Returns:
        (T, V, 2) left and right.
    """
    out = np.zeros((len(times), len(facing), 2), dtype=np.bool_)
    begin = paths.change_start - LEAD_S
    end = paths.change_start + _UNTIL * paths.change_duration
    obeyed = (np.arange(len(begin)) * _GOLDEN) % 1.0 < _OBEY
    there = obeyed & (begin < times.max(initial=-np.inf)) & (end > times.min(initial=np.inf))
    for k in np.flatnonzero(there):
        v = paths.change_vehicle[k]
        side = int(paths.change_shift[k] * facing[v] > 0.0)
        out[:, v, side] |= (times >= begin[k]) & (times < end[k])
    return out


def blink(times: FloatArray, rate_hz: FloatArray, phase: FloatArray) -> FloatArray:
    """How bright indicators are, (T, V) from 0 to 1, at times (T,) (s), by their rates and phases (V,)."""
    period = (times[:, None] * rate_hz + phase) % 1.0
    out: FloatArray = np.clip(np.minimum(period, 0.5 - period) / (_RISE_S * rate_hz), 0.0, 1.0)
    return out
