"""Ends of tracks that stay behind: what no vehicle can do, tells the points that are not the vehicle's.

A box whose vehicle leaves the picture often stays at the edge for some frames, and a track may begin on what
stands there. For a fit that weighs points by how many agree, such an end can be the majority. But a vehicle
brakes with 1 g at most: where a track comes to stand faster than that, the end that stands is no part of it.
"""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray

#: The most that tyres on a dry road can do (m/s²).
MOST_BRAKING = 9.81
#: An end stands below this share of the speed beside it.
_STANDS = 0.15
#: No vehicle is faster than this (m/s): a leap of the points beside a slow end says nothing of that end.
_FASTEST = 70.0
#: Points on either side of a change of speed, tried in this order; and the fewest that an end has.
_WINDOWS = (3, 6, 12, 25)
_LEAST = 2
#: A change of speed counts beyond so many of its standard deviations.
_SURE = 4.0
_ROUNDS = 3
#: Of tracks with more than twice as many points only every so many are looked at.
_MOST = 100


def vehicles_part(t: FloatArray, xy: FloatArray, sigma: FloatArray) -> slice:
    """Find the part of a track that a vehicle can have driven.

    Args:
        t: (N,) times, ascending (s).
        xy: (N, 2) places on the road (m).
        sigma: (N,) standard deviations of a place along the way (m).

    Returns:
        The points between the ends that stay behind; all of them where no end does.
    """
    begin, end = 0, len(t)
    for _ in range(_ROUNDS):
        own = slice(begin, end)
        last = _stays_from(t[own], xy[own], sigma[own])
        back = slice(begin, end if last is None else begin + last)
        # What stays before the vehicle comes stays, seen backwards in time, after it has gone.
        first = _stays_from(-t[back][::-1], xy[back][::-1], sigma[back][::-1])
        if last is None and first is None:
            break
        begin, end = back.start + (0 if first is None else back.stop - back.start - first), back.stop
    return slice(begin, end)


def _stays_from(t: FloatArray, xy: FloatArray, sigma: FloatArray) -> int | None:
    """Index of the first point of an end that stays behind, or None."""
    every = max(len(t) // _MOST, 1)
    if every > 1:  # of a long track every so many points, its last one included
        begin = (len(t) - 1) % every
        found_at = _stays_from(t[begin::every], xy[begin::every], sigma[begin::every])
        return None if found_at is None else begin + every * found_at
    n = len(t)
    if n < _WINDOWS[0] + _LEAST or not _may_stay(t, xy):
        return None
    found: list[tuple[float, int]] = []
    for window in _WINDOWS:
        for k in range(window, n - _LEAST + 1):
            before, after = slice(k - window, k), slice(k, min(k + window, n))
            v, var_v, at, miss = _speed(t[before], xy[before], sigma[before])
            size = float(np.hypot(*v))
            w, var_w, later, miss_after = _speed(t[after], xy[after], sigma[after])
            rest, *_ = _speed(t[k:], xy[k:], sigma[k:])
            left = float(np.hypot(*w))
            sure = size - left - _SURE * np.sqrt(var_v + var_w)
            stands = max(left, float(np.hypot(*rest))) < _STANDS * size
            if stands and size < _FASTEST and sure > MOST_BRAKING * (later - at):
                found.append((miss + miss_after, k))
        if found:
            return min(found)[1]
    return None


def _may_stay(t: FloatArray, xy: FloatArray) -> bool:
    """Whether a track is slow over some last points, beside what it is elsewhere: else nothing stays."""
    fast = float(np.percentile(np.hypot(*(xy[2:] - xy[:-2]).T) / (t[2:] - t[:-2]), 90.0))
    ends = [min(k, len(t)) for k in (_LEAST, *_WINDOWS)]
    return any(np.hypot(*(xy[-1] - xy[-k])) < 0.5 * fast * (t[-1] - t[-k]) for k in ends)


def _speed(t: FloatArray, xy: FloatArray, sigma: FloatArray) -> tuple[FloatArray, float, float, float]:
    """Velocity (2,) by a straight line, its variance, the mean time, and the mean square of what is left."""
    at = float(t.mean())
    s = t - at
    spread = float(s @ s)
    middle = xy.mean(axis=0)
    v = s @ (xy - middle) / spread
    miss = ((xy - middle - s[:, None] * v) ** 2).sum(axis=1) / sigma**2
    return v, float((s**2 * sigma**2).sum()) / spread**2, at, float(miss.mean())
