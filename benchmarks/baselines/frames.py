"""What a baseline is given at a frame, and what it gives back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from jeat_graph.data.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class BaselineFrame:
    """Boxes of one frame.

    Attributes:
        t: time (s).
        boxes: (M, 4) left, top, width, height (px).
        scores: (M,) confidence.
        sensor: (M,) index into the sensors asked for.
    """

    t: float
    boxes: FloatArray
    scores: FloatArray
    sensor: IntArray


@dataclass(frozen=True, eq=False)
class TrackedFrame:
    """Confirmed tracks of one frame.

    Attributes:
        track_id: (N,) identities.
        boxes: (N, 4) left, top, width, height (px), as the tracker reports them.
        scores: (N,) confidence of the detection; 0 where there was none.
        used: (N,) bit mask of the sensor whose detection was used; 0 where there was none.
        velocity: (N, 2) of the box centres by the tracker's own filter (px/s).
    """

    track_id: IntArray
    boxes: FloatArray
    scores: FloatArray
    used: IntArray
    velocity: FloatArray


class FrameTracker(Protocol):
    """A tracker that takes one frame after the other."""

    def step(self, frame: BaselineFrame) -> TrackedFrame:
        """Take in a frame."""
        ...
