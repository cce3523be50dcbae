"""Lamps that flicker with the mains: their pixels are left out of what moves in events.

Light on mains of 50 or 60 Hz is brightest 100 or 120 times a second. A pixel that sees a lamp grows brighter
again and again after that time, while an edge that moves passes each pixel once. Whoever has few pixels with
events around it that do not flicker is of the lamp too.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.core import detection as core
from jeat_graph.data.events import EventArray

# A period is 10 or 8.3 ms; a pixel's events are late or early by a millisecond. After two periods it is a
# lamp, after a tenth of a second of silence none any more (µs).
RULE = (7_400, 11_500, 100_000, 2)
# Where this share of the pixels with events, so far around (px), flickers, all of them are of the lamp.
_SHARE, _AROUND_PX = 0.25, 5
_LONG_AGO = -(1 << 62)


class Lamps:
    """Knows which pixels flicker, by events that come piece by piece.

    Args:
        size_px: width and height of the picture; events outside are passed over.
    """

    def __init__(self, size_px: tuple[int, int]) -> None:
        width, height = size_px
        self._rise = np.full((height, width), _LONG_AGO, dtype=np.int64)
        self._state = np.zeros((height, width), dtype=np.uint8)

    def watch(self, events: EventArray) -> None:
        """Take the next events."""
        good = np.ones(len(events), dtype=bool)
        core.leave_flicker(*events.contiguous(), self._rise, self._state, RULE, good)

    def without(self, marks: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Return events a pixel (H, W) without those of lamps, also such from before they were known."""
        import cv2

        flickers = self._state >= 2 * RULE[3]
        if not flickers.any():
            return marks
        size = (_AROUND_PX, _AROUND_PX)
        lamps = cv2.boxFilter(flickers.astype(np.float32), -1, size)
        there = cv2.boxFilter(((marks > 0) | flickers).astype(np.float32), -1, size)
        of_lamps = flickers | ((lamps > 0.0) & (lamps >= _SHARE * there))
        return np.where(of_lamps, 0, marks).astype(marks.dtype)
