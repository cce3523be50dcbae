"""Where tracks met: the stretches of time in which two of them were near one another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray, RecordArray

#: Tracks are looked at so often (s); nothing passes through a vehicle in less.
_STEP_S = 0.05
#: Tracks are near one another where the distance of their middles is below so many sums of their sizes, in
#: width and in height. Half of a sum, and they touch; half as far again, for where they touch one is hidden.
_REACH = 0.75
#: So many looks at a time, for bounded memory.
_LOOKS = 2000


class Encounters(NamedTuple):
    """Stretches of time in which two tracks were near one another, in order of their ends.

    Attributes:
        first: (E,) index of one track.
        second: (E,) index of the other, greater than the first.
        start_t: (E,) a time at which they were not near yet (s), or at which one began.
        end_t: (E,) a time at which they were not near any more (s), or at which one ended.
    """

    first: IntArray
    second: IntArray
    start_t: FloatArray
    end_t: FloatArray


def encounters(tracks: Sequence[RecordArray]) -> Encounters:
    """Find where any two of N tracks met while both lived, from their measurements (M,) in order of time."""
    start = np.array([np.ceil(rows["t"][0] / _STEP_S) for rows in tracks], dtype=np.int64)
    end = np.array([np.floor(rows["t"][-1] / _STEP_S) for rows in tracks], dtype=np.int64) + 1
    parts = [np.zeros((0, 3), dtype=np.int64)]
    lived = [np.arange(a, b + 1) for a, b in zip(start // _LOOKS, (end - 1) // _LOOKS, strict=True)]
    for low in np.unique(np.concatenate(lived)) * _LOOKS if lived else ():
        alive = np.flatnonzero((start < low + _LOOKS) & (end > low) & (start < end))
        if len(alive) > 1:
            looks = [np.arange(max(start[k], low), min(end[k], low + _LOOKS)) for k in alive]
            boxes = [_boxes(tracks[int(k)], look * _STEP_S) for k, look in zip(alive, looks, strict=True)]
            track = np.repeat(alive, [len(look) for look in looks])
            look = np.concatenate(looks)
            order = np.argsort(look, kind="stable")
            parts.append(_touching(look[order], track[order], np.concatenate(boxes)[order]))
    return _stretches(np.concatenate(parts))


def _boxes(rows: RecordArray, t: FloatArray) -> FloatArray:
    """Centre and reach (T, 4) at times (T,), on straight lines between measurements."""
    columns = [np.interp(t, rows["t"], rows["z"][:, axis]) for axis in range(2)]
    columns += [_REACH * np.exp(np.interp(t, rows["t"], rows["log_size"][:, axis])) for axis in range(2)]
    return np.stack(columns, axis=1)


@njit(cache=True)
def _touching(look: IntArray, track: IntArray, boxes: FloatArray) -> IntArray:
    """Pairs of tracks that are near one another: (P, 3) the lesser, the greater, the look.

    Args:
        look: (B,) when, ascending.
        track: (B,) whose box it is, ascending within a look.
        boxes: (B, 4) centre and reach (px).
    """
    found = np.empty((64, 3), dtype=np.int64)
    count = begin = 0
    for b in range(len(look)):
        if look[b] != look[begin]:
            begin = b
        for a in range(begin, b):
            if (
                abs(boxes[a, 0] - boxes[b, 0]) < boxes[a, 2] + boxes[b, 2]
                and abs(boxes[a, 1] - boxes[b, 1]) < boxes[a, 3] + boxes[b, 3]
            ):
                if count == len(found):
                    larger = np.empty((2 * count, 3), dtype=np.int64)
                    larger[:count] = found
                    found = larger
                found[count, 0], found[count, 1], found[count, 2] = track[a], track[b], look[b]
                count += 1
    return found[:count]


def _stretches(touching: IntArray) -> Encounters:
    """Join consecutive looks (P, 3) of a pair to one encounter, a look longer on either side."""
    rows = touching[np.lexsort(touching.T[::-1])]
    begins = np.ones(len(rows), dtype=np.bool_)
    begins[1:] = (np.diff(rows[:, :2], axis=0) != 0).any(axis=1) | (np.diff(rows[:, 2]) > 1)
    first = np.flatnonzero(begins)
    last = np.append(first[1:], len(rows)) - 1 if len(first) else first
    start_t, end_t = (rows[first, 2] - 1) * _STEP_S, (rows[last, 2] + 1) * _STEP_S
    order = np.lexsort((rows[first, 1], rows[first, 0], end_t))
    first = first[order]
    return Encounters(rows[first, 0], rows[first, 1], start_t[order], end_t[order])
