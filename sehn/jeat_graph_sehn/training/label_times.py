"""Boxes of labels at their own times: between two labels nobody knows where a vehicle was."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.trajectories import GroundTruth
from jeat_graph_sehn.training.truth_at import TrueBoxes, TruthByTime

#: A window that ends so near to a label is of its time (s): half of a bin.
_AT_LABEL_S = 2.5e-3
#: Far beyond every picture (px).
_BEYOND = 1e5
#: What is there where no label is: anything, anywhere. It is neither asked for nor wrong.
UNKNOWN = TrueBoxes(
    np.array([[-_BEYOND, -_BEYOND, _BEYOND, _BEYOND]]), np.array([True]), np.array([-1], dtype=np.int64)
)


class LabelTimes(TruthByTime):
    """Looks up boxes of labels.

    Args:
        truth: of one recording; its frames are the times of the labels.
        moving_only: whether who has hardly moved is ignored, as is right where the camera stands still.
    """

    own_times = True

    def __init__(self, truth: GroundTruth, moving_only: bool = False) -> None:
        super().__init__(truth)
        self._moving_only = moving_only

    def at(self, t: float) -> TrueBoxes:
        """Return the boxes of the label at a time (s); `UNKNOWN` where there is none."""
        index = self._nearest(t)
        return UNKNOWN if abs(self.times[index] - t) > _AT_LABEL_S else self.at_frame(index)

    def asked(self, start: float, end: float, least_px: float) -> TrueBoxes:
        """Return the boxes at `end` (s); where the camera moves, events show who stands, too."""
        return super().asked(start, end, least_px) if self._moving_only else self.at(end)

    def asked_since(self, start: float, ends: list[float], least_px: float) -> list[TrueBoxes]:
        """Return what `asked` says of each of some ends (s, ascending)."""
        if self._moving_only:
            return super().asked_since(start, ends, least_px)
        return [self.at(end) for end in ends]

    def begin_us(self, window_us: float) -> float:
        """Return from when on sequences may be (µs): they need events before a label, and no label there."""
        return 0.0

    def to_label_s(self, t: float) -> float:
        """Return how much later than `t` the nearest label is (s)."""
        return float(self.times[self._nearest(t)]) - t

    def _nearest(self, t: float) -> int:
        after = int(np.clip(np.searchsorted(self.times, t), 0, len(self.times) - 1))
        before = max(after - 1, 0)
        return before if abs(self.times[before] - t) <= abs(self.times[after] - t) else after
