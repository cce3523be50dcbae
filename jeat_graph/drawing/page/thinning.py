"""Thins curves to fewer points that look the same, always in the same way."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray

_DIGITS = 4


def spread(count: int, most: int) -> IntArray:
    """Choose at most `most` (at least 2) of `count` rows, evenly, the first and the last among them."""
    if count <= max(most, 2):
        return np.arange(count, dtype=np.int64)
    return np.unique(np.rint(np.linspace(0, count - 1, max(most, 2))).astype(np.int64))


def extremes(t: FloatArray, y: FloatArray, bins: int) -> IntArray:
    """Choose the rows with the least and greatest value in each bin of time, so that no peak is lost.

    Args:
        t: (N,) ascending (s).
        y: (N,) values, without NaN.
        bins: number of bins; at most 2 `bins` + 2 rows are kept.

    Returns:
        Rows, ascending; the first and the last are among them.
    """
    if len(t) <= 2 * bins + 2:
        return np.arange(len(t), dtype=np.int64)
    width = max(float(t[-1] - t[0]), 1e-9) / bins
    column = np.minimum(((t - t[0]) / width).astype(np.int64), bins - 1)
    order = np.lexsort((y, column))
    first = np.flatnonzero(np.diff(column[order], prepend=-1))
    last = np.append(first[1:], len(order)) - 1
    return np.unique(np.concatenate([[0], order[first], order[last], [len(t) - 1]]))


def sample(t: FloatArray, y: FloatArray, most: int) -> IntArray:
    """Choose an even sample of single points, and beside it the greatest value in each stretch of time.

    Extremes alone would show a cloud of points as two bands.

    Args:
        t: (N,) ascending (s).
        y: (N,) values, without NaN.
        most: about how many to choose.
    """
    if len(t) <= most:
        return np.arange(len(t), dtype=np.int64)
    edges = spread(len(t), most // 6)
    part = np.searchsorted(edges, np.arange(len(t)), side="right")
    order = np.lexsort((-y, part))
    peaks = order[np.flatnonzero(np.diff(part[order], prepend=-1))]
    return np.union1d(spread(len(t), most - len(peaks)), peaks)


def occupied(t: FloatArray, start: float, width: float) -> list[int]:
    """Numbers of the bins of `width` (s) from `start` on that hold any of the times (N,), ascending."""
    if not len(t):
        return []
    found: list[int] = np.unique(np.floor((t - start) / width + 1e-9).astype(np.int64)).tolist()
    return found


def short(values: FloatArray) -> list[Any]:
    """Round to four significant digits for JSON; whole numbers lose their point, NaN becomes None."""
    return [_short(value) for value in np.asarray(values, dtype=np.float64).tolist()]


def _short(value: float) -> float | int | None:
    if not math.isfinite(value):
        return None
    rounded = float(f"{value:.{_DIGITS}g}")
    return int(rounded) if rounded == int(rounded) else rounded


def milliseconds(t: FloatArray, start: float) -> list[int]:
    """Times (N,) as whole milliseconds since `start`."""
    whole: list[int] = np.rint(1e3 * (t - start)).astype(np.int64).tolist()
    return whole
