"""True boxes at any time: between two frames of the truth they are taken to move evenly."""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.interop import to_xyxy
from jeat_graph.data.trajectories import GroundTruth

#: Two frames farther apart than this are not of one motion (s).
_LONGEST_GAP_S = 0.25
_SAME_S = 1e-6
_US = 1e6


class TrueBoxes(NamedTuple):
    """What is to be seen in a picture.

    Attributes:
        corners: (G, 4) left, top, right, bottom (px).
        ignored: (G,) whether a box is neither asked for nor wrong.
        object_id: (G,) identity.
    """

    corners: FloatArray
    ignored: BoolArray
    object_id: IntArray


class TruthByTime:
    """Looks up true boxes by time.

    Args:
        truth: of one recording.

    Attributes:
        times: (T,) of the frames of the truth (s), ascending.
        own_times: whether it holds at these times alone.
    """

    own_times: ClassVar[bool] = False

    def __init__(self, truth: GroundTruth) -> None:
        self.times = truth.frame_times()
        order = np.argsort(truth.t, kind="stable")
        self._start = np.searchsorted(truth.t[order], self.times - _SAME_S)
        self._end = np.searchsorted(truth.t[order], self.times + _SAME_S)
        self._corners = to_xyxy(truth.boxes)[order]
        self._ignored = truth.ignore[order]
        self._id = truth.object_id[order]

    def at_frame(self, index: int) -> TrueBoxes:
        """Return the boxes of a frame of the truth."""
        rows = slice(int(self._start[index]), int(self._end[index]))
        return TrueBoxes(self._corners[rows], self._ignored[rows], self._id[rows])

    def at(self, t: float) -> TrueBoxes:
        """Return the boxes at a time (s); of those seen before and after, what lies between.

        A vehicle in only one of the two frames is ignored: nobody knows when it came or went.
        """
        after = int(np.clip(np.searchsorted(self.times, t - _SAME_S), 0, len(self.times) - 1))
        before = max(after - 1, 0)
        gap = self.times[after] - self.times[before]
        if (
            abs(self.times[after] - t) <= _SAME_S
            or gap <= 0.0
            or gap > _LONGEST_GAP_S
            or t > self.times[after]
        ):
            return self.at_frame(after)
        a, b = self.at_frame(before), self.at_frame(after)
        share = (t - self.times[before]) / gap
        _, in_a, in_b = np.intersect1d(a.object_id, b.object_id, return_indices=True)
        moved = (1.0 - share) * a.corners[in_a] + share * b.corners[in_b]
        lone_a = np.setdiff1d(np.arange(len(a.object_id)), in_a)
        lone_b = np.setdiff1d(np.arange(len(b.object_id)), in_b)
        lone = np.ones(len(lone_a) + len(lone_b), dtype=bool)
        return TrueBoxes(
            np.concatenate([moved, a.corners[lone_a], b.corners[lone_b]]),
            np.concatenate([a.ignored[in_a] | b.ignored[in_b], lone]),
            np.concatenate([a.object_id[in_a], a.object_id[lone_a], b.object_id[lone_b]]),
        )

    def asked(self, start: float, end: float, least_px: float) -> TrueBoxes:
        """Return the boxes at `end` (s); who has hardly moved since `start` left no events and is ignored.

        Args:
            start: when the events that are seen begin (s).
            end: when they end (s).
            least_px: who has gone less has hardly moved.
        """
        truth = self.at(end)
        moving = self.moved(start, end, least_px)
        still = np.array([one not in moving for one in truth.object_id.tolist()], dtype=bool)
        return truth._replace(ignored=truth.ignored | still)

    def asked_since(self, start: float, ends: list[float], least_px: float) -> list[TrueBoxes]:
        """Return what `asked` says of each of some ends (s, ascending), in the time of the last one."""
        ways: dict[int, float] = {}
        before, found = start, []
        for end in ends:
            for one, way in self._ways(before, end).items():
                ways[one] = ways.get(one, 0.0) + way
            before = end
            truth = self.at(end)
            still = [ways.get(one, 0.0) < least_px for one in truth.object_id.tolist()]
            found.append(truth._replace(ignored=truth.ignored | np.array(still, dtype=bool)))
        return found

    def begin_us(self, window_us: float) -> float:
        """Return from when on sequences may be (µs): the first window may end at the first frame."""
        return float(self.times[0]) * _US - window_us

    def to_label_s(self, t: float) -> float:
        """Return by how much a sequence that ends at `t` is to end later (s): it may end at any time."""
        return 0.0

    def moved(self, start: float, end: float, least_px: float) -> set[int]:
        """Return who has gone at least `least_px` from `start` to `end` (s), to and fro counting the same.

        The way of that side of the box counts that goes farthest: what comes straight at the camera grows.
        """
        return {one for one, way in self._ways(start, end).items() if way >= least_px}

    def _ways(self, start: float, end: float) -> dict[int, float]:
        """Return how far each has gone from `start` to `end` (s), as `moved` counts (px)."""
        first = max(int(np.searchsorted(self.times, start + _SAME_S)) - 1, 0)
        last = min(int(np.searchsorted(self.times, end - _SAME_S)), len(self.times) - 1)
        ways: dict[int, float] = {}
        for k in range(first, last):
            gap = self.times[k + 1] - self.times[k]
            if not 0.0 < gap <= _LONGEST_GAP_S:
                continue
            share = (min(end, self.times[k + 1]) - max(start, self.times[k])) / gap
            a, b = self.at_frame(k), self.at_frame(k + 1)
            same, in_a, in_b = np.intersect1d(a.object_id, b.object_id, return_indices=True)
            way = share * np.abs(b.corners[in_b] - a.corners[in_a]).max(axis=1)
            for one, part in zip(same.tolist(), way.tolist(), strict=True):
                ways[one] = ways.get(one, 0.0) + part
        return ways
