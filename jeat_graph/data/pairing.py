"""Scans of different sensors at nearly the same time, brought to one time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.detections import Detections

#: Times are decimal numbers: 0.13 − 0.12 is a hair more than 0.01 (s).
_ROUNDING_S = 1e-9


def meet(first_s: float, last_s: float, within_s: float) -> bool:
    """Return whether two times (s) are no further apart than a tolerance (s)."""
    return last_s - first_s <= within_s + _ROUNDING_S


def paired_times(t: FloatArray, sensor: IntArray, within_s: float) -> FloatArray:
    """Return the common times (K,) of scans (s): of each group the time of its last scan.

    A group begins with the first scan that is in none. The next times join it, all scans of one time or none,
    while they come no more than `within_s` after its first scan and no sensor would be in it twice. Below
    half of the shortest period of a sensor each scan meets the nearest one of another sensor.

    Args:
        t: (K,) times (s), not decreasing.
        sensor: (K,) which sensor each is of; none twice at one time.
        within_s: tolerance (s), >= 0.
    """
    starts = np.flatnonzero(np.diff(t, prepend=-np.inf) != 0)
    ends = np.append(starts, len(t))[1:]
    out = t.copy()
    begin, members = 0, set[int]()
    for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
        more = set(sensor[start:end].tolist())
        if members and (members & more or not meet(t[begin], t[start], within_s)):
            begin, members = start, set()
        members |= more
        out[begin:end] = t[start]
    return out


def paired(detections: Detections, within_s: float) -> Detections:
    """Bring scans of different sensors that are no more than `within_s` (s) apart to the time of the last.

    Boxes stay as they are: what moves at v px/s is taken up to v · `within_s` px from where it is then.
    """
    if within_s <= 0.0:
        return detections
    t = paired_times(detections.scan_t, detections.scan_sensor, within_s)
    # Of one group the scans are put in the order of their sensors, as everywhere.
    order = np.lexsort((detections.scan_sensor, t))
    if (order == np.arange(len(t))).all():
        return replace(detections, scan_t=t)
    moved = replace(detections, scan_t=t)
    return Detections.from_scans(moved.scan(k) for k in order.tolist())
