"""How long things took, counted in bins, so that memory does not grow with how many there were."""

from __future__ import annotations

import math

import numpy as np

from jeat_graph.data.arrays import IntArray

#: The bins reach from a microsecond to a quarter of an hour, each 1 % wider than the one before.
_LEAST_S, _RATIO, _BINS = 1e-6, 1.01, 2100


class LatencyCounts:
    """Durations by bins of 1 %, and the longest.

    Attributes:
        counts: (BINS,) how many fell into each bin.
        max_s: the longest (s).
    """

    def __init__(self) -> None:
        self.counts: IntArray = np.zeros(_BINS, dtype=np.int64)
        self.max_s = 0.0

    def __len__(self) -> int:
        return int(self.counts.sum())

    def add(self, seconds: float) -> None:
        """Count one duration (s)."""
        place = int(math.log(max(seconds / _LEAST_S, 1.0)) / math.log(_RATIO))
        self.counts[min(place, _BINS - 1)] += 1
        self.max_s = max(self.max_s, seconds)

    def clear(self) -> None:
        """Forget all."""
        self.counts[:] = 0
        self.max_s = 0.0

    def quantile(self, share: float) -> float:
        """Return the duration (s) that this share stays below, to 1 %; NaN where none was counted."""
        below = np.cumsum(self.counts)
        if not below[-1]:
            return math.nan
        place = int(np.searchsorted(below, share * below[-1]))
        return min(float(_LEAST_S * _RATIO ** (place + 0.5)), self.max_s)
