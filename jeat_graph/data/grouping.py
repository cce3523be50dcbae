"""Rows of a table grouped into scans: one sensor at one time each, in order of time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray


class Groups(NamedTuple):
    """Which rows make which scan.

    Attributes:
        first: (K,) a row of each scan.
        start: (K + 1,) scan k owns `rows[start[k]:start[k + 1]]`.
        rows: (N,) the rows with boxes, scan by scan; None where that is all rows, as they are.
        scan: (R,) the scan of each row.
    """

    first: IntArray
    start: IntArray
    rows: IntArray | None
    scan: IntArray


def group_rows(time: FloatArray, code: IntArray, empty: BoolArray) -> Groups:
    """Group rows, in any order, by time and then by sensor; rows of one scan keep their order.

    Args:
        time: (R,) finite times (s).
        code: (R,) number of the sensor.
        empty: (R,) true where the row holds no box.
    """
    later, same = time[1:] > time[:-1], time[1:] == time[:-1]
    sorted_already = bool((later | (same & (code[1:] >= code[:-1]))).all())
    order = None if sorted_already else np.lexsort((code, time))  # a stable sort
    if order is not None:
        time, code, empty = time[order], code[order], empty[order]
        same = time[1:] == time[:-1]
    begins = np.ones(len(time), dtype=bool)
    begins[1:] = ~same | (code[1:] != code[:-1])
    begin = np.flatnonzero(begins)
    ends = np.append(begin, len(time)).astype(np.int64)
    first = begin if order is None else order[begin]
    scan = np.cumsum(begins, dtype=np.int64) - 1
    if order is not None:
        scan[order] = scan.copy()
    if not empty.any():
        return Groups(first, ends, order, scan)
    kept = np.flatnonzero(~empty)
    return Groups(first, np.searchsorted(kept, ends), kept if order is None else order[kept], scan)
