"""The times at which the sensors looked while a track was alive: those of its rows in the smoothed table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class ObservationTimes:
    """What the tracker held of one track at each step of its life.

    Attributes:
        t: (K,) times of the steps (s), ascending.
        existence: (K,) causal probability that the track is a vehicle.
        used: (K,) bit k is set where a detection of sensor k was taken.
        held: (K,) whether it was reported as standing still, if need be without any detection.
    """

    t: FloatArray
    existence: FloatArray
    used: IntArray
    held: BoolArray

    def __len__(self) -> int:
        return len(self.t)

    def select(self, rows: slice | npt.NDArray[np.intp] | BoolArray) -> ObservationTimes:
        """Return some of the steps."""
        return ObservationTimes(self.t[rows], self.existence[rows], self.used[rows], self.held[rows])

    @staticmethod
    def empty() -> ObservationTimes:
        """Return none."""
        none = np.zeros(0)
        return ObservationTimes(none, none, np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.bool_))

    @staticmethod
    def unseen(t: FloatArray) -> ObservationTimes:
        """Return times `t` (K,) between two fragments of one vehicle."""
        count = len(t)
        return ObservationTimes(
            t, np.zeros(count), np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.bool_)
        )

    @staticmethod
    def concatenate(parts: Sequence[ObservationTimes]) -> ObservationTimes:
        """Join consecutive stretches."""
        if len(parts) == 1:
            return parts[0]
        if not parts:
            return ObservationTimes.empty()
        return ObservationTimes(
            np.concatenate([part.t for part in parts]),
            np.concatenate([part.existence for part in parts]),
            np.concatenate([part.used for part in parts]),
            np.concatenate([part.held for part in parts]),
        )

    def hindsight(self) -> FloatArray:
        """Existence (K,) seen from the end: what exists later has existed since its birth.

        The greatest of the causal probabilities from each step on, a lower bound of the smoothed one.
        """
        return np.asarray(np.maximum.accumulate(self.existence[::-1])[::-1])
