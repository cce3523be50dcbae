"""GTSAM's incremental fixed-lag smoother over the segments of one live track."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.smoothers.gtsam.elimination import SegmentRows, prior_rows
from jeat_graph.smoothers.gtsam.linear_graph import LinearGraph
from jeat_graph.smoothers.gtsam.window import GtsamWindow


class FixedLagChain:
    """The states at the ends of a track's segments, numbered from 0 as they come.

    Every method but `reference` may raise `GtsamError`; after that the object is not to be used again.

    Args:
        mean: (2, 3) of the first state, per axis [p, v, a] (px, px/s, px/s²).
        cov: (3, 3) its covariance along either axis.
    """

    def __init__(self, mean: FloatArray, cov: FloatArray) -> None:
        self._window = GtsamWindow(mean.shape[-1])
        self._prior = cov
        self._references = [mean]  # of the states in the window
        self._oldest = self._newest = 0  # numbers of the first and the last state in it
        self._begun = False

    def append(self, factors: Sequence[FloatArray], references: Sequence[FloatArray]) -> None:
        """Take in segments behind the newest state.

        Args:
            factors: (6, 8) each (`gtsam.elimination`).
            references: (2, 3) each: what its last state is counted from.
        """
        if not factors:
            return
        graph, first = LinearGraph(references[0].shape[-1]), self._newest + 1
        if not self._begun:
            graph.add_prior(0, *prior_rows(self._prior))
            self._begun, first = True, 0
        for factor in factors:
            graph.add_segment(self._newest, SegmentRows.of(factor))
            self._newest += 1
        self._references.extend(references)
        self._window.update(graph, first, self._newest - first + 1)

    def means(self, numbers: range) -> FloatArray:
        """Return the means (N, 2, 3) of states of the window, given all that was taken in."""
        first, last = numbers.start - self._oldest, numbers.stop - self._oldest
        return self._window.means(list(numbers), np.array(self._references[first:last]))

    def leave(self, count: int) -> None:
        """Marginalise the `count` oldest states with the next segment; nothing is asked of them any more."""
        del self._references[:count]
        self._window.leaving(range(self._oldest, self._oldest + count))
        self._oldest += count
