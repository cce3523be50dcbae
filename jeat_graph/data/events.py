"""Events of an event camera, in columns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, IntArray
from jeat_graph.data.errors import DataError


@dataclass(frozen=True, eq=False)
class EventArray:
    """Events in the order of their times.

    Attributes:
        t_us: (N,) int64 time since the beginning of the recording (µs), not decreasing.
        x: (N,) uint16 column (px).
        y: (N,) uint16 row (px).
        polarity: (N,) uint8, 1 where it became brighter, 0 where darker.
        by_motion: (N,) true for events caused by a change of the scene, false for noise; None where the
            source does not know, as of a real camera.
    """

    t_us: IntArray
    x: npt.NDArray[np.uint16]
    y: npt.NDArray[np.uint16]
    polarity: npt.NDArray[np.uint8]
    by_motion: BoolArray | None = None

    def __post_init__(self) -> None:
        lengths = {len(column) for column in self._columns() if column is not None}
        if len(lengths) > 1:
            raise DataError(f"events: columns of different lengths {sorted(lengths)}")
        if len(self.t_us) and (np.diff(self.t_us) < 0).any():
            raise DataError("events: times run backwards")

    def __len__(self) -> int:
        return len(self.t_us)

    def take(self, rows: slice | npt.NDArray[Any]) -> EventArray:
        """Return the given rows, which must keep the order of time."""
        labels = None if self.by_motion is None else self.by_motion[rows]
        return EventArray(self.t_us[rows], self.x[rows], self.y[rows], self.polarity[rows], labels)

    def between(self, start_us: int, end_us: int) -> EventArray:
        """Return the events with `start_us` <= t < `end_us`."""
        first, last = np.searchsorted(self.t_us, [start_us, end_us])
        return self.take(slice(int(first), int(last)))

    def contiguous(
        self,
    ) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.uint16], npt.NDArray[np.uint16], npt.NDArray[np.uint8]]:
        """Return times (µs), x, y and polarities, each (N,), as the core takes them."""
        return (
            np.ascontiguousarray(self.t_us, np.int64),
            np.ascontiguousarray(self.x, np.uint16),
            np.ascontiguousarray(self.y, np.uint16),
            np.ascontiguousarray(self.polarity, np.uint8),
        )

    @staticmethod
    def trusted(
        t_us: IntArray,
        x: npt.NDArray[np.uint16],
        y: npt.NDArray[np.uint16],
        polarity: npt.NDArray[np.uint8],
    ) -> EventArray:
        """Make an array of columns that are known to fit and to be in order, without looking at them."""
        events = object.__new__(EventArray)
        columns = {"t_us": t_us, "x": x, "y": y, "polarity": polarity, "by_motion": None}
        for name, column in columns.items():
            object.__setattr__(events, name, column)
        return events

    @staticmethod
    def empty(labelled: bool = False) -> EventArray:
        """Return no events, with labels or without."""
        return EventArray(
            np.zeros(0, dtype=np.int64),
            np.zeros(0, dtype=np.uint16),
            np.zeros(0, dtype=np.uint16),
            np.zeros(0, dtype=np.uint8),
            np.zeros(0, dtype=bool) if labelled else None,
        )

    @staticmethod
    def concatenate(parts: list[EventArray]) -> EventArray:
        """Join arrays that follow one another in time; labels survive where every part has them."""
        if not parts:
            return EventArray.empty()
        labels = [part.by_motion for part in parts if part.by_motion is not None]
        return EventArray(
            np.concatenate([part.t_us for part in parts]),
            np.concatenate([part.x for part in parts]),
            np.concatenate([part.y for part in parts]),
            np.concatenate([part.polarity for part in parts]),
            np.concatenate(labels) if len(labels) == len(parts) else None,
        )

    def _columns(self) -> tuple[npt.NDArray[Any] | None, ...]:
        return self.t_us, self.x, self.y, self.polarity, self.by_motion
