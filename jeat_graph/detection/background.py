"""Tells events of what moves from those that a place always has: noise, and light that trembles.

In the dark an event camera makes noise everywhere, so much of it that all pixels have neighbours that fired
and everything is one cloud. But noise goes on where it is, and what moves comes and goes: the events around
each pixel are compared with how many there usually are. They come as independent ones do, so their number
has the variance of its mean, and a place stands out where there are more than chance brings.

What is usual is followed slowly, and hardly follows what stands out. At first it is what the quieter parts of
the picture nearby have, for whatever moves there is not everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from jeat_graph.config.fields import Section, number
from jeat_graph.core import detection as core

_Counts = npt.NDArray[np.uint16]
_Means = npt.NDArray[np.float32]
#: What is usual at first: of so many by so many parts of the picture (px) the one that this share is below.
_PART_PX, _PARTS, _QUIETER = 16, 9, 0.25


@dataclass(frozen=True)
class BackgroundSettings(Section):
    """What stands out of the events that a place always has."""

    sigmas: float = number(
        5.0,
        "σ",
        "events count where so many more than usual are around them, in deviations of independent ones; 0: "
        "all count",
        0.0,
    )
    around_px: int = number(5, "px", "side of the square in which events are counted", 1, 99)
    adapt_s: float = number(4.0, "s", "what is usual follows in this time", open_low=True)


class UsualActivity:
    """Follows how many events each place has, and leaves in a window those that stand out.

    Args:
        size_px: width and height of the picture.
        rate_hz: windows per second.
        settings: how.
    """

    def __init__(self, size_px: tuple[int, int], rate_hz: float, settings: BackgroundSettings) -> None:
        self._settings = settings
        self._share = min(1.0 / (settings.adapt_s * rate_hz), 1.0)
        width, height = size_px
        self._mean: _Means = np.zeros((height, width), dtype=np.float32)
        self._seen = 0

    def forget(self) -> None:
        """Start over: what was usual is no longer."""
        self._seen = 0

    def standing_out(self, counts: _Counts) -> _Counts:
        """Return the counts (H, W) of a window, with 0 where no more events are around than usual.

        Args:
            counts: (H, W) events of each pixel; windows must come in their order.
        """
        settings = self._settings
        if settings.sigmas <= 0.0:
            return counts
        side = (settings.around_px, settings.around_px)
        edge = cv2.BORDER_REFLECT_101
        around: Any = cv2.boxFilter(counts, cv2.CV_32F, side, normalize=False, borderType=edge)
        if self._seen == 0:
            self._mean = _usual(around)
        self._seen += 1
        first = max(self._share, 1.0 / (self._seen + 1.0))
        out = np.empty_like(counts)
        core.mark_unusual(counts, around, self._mean, (settings.sigmas, first, self._share), out)
        return out


def _usual(around: _Means) -> _Means:
    """Return of the sums (H, W) around each pixel what the quieter parts nearby have."""
    height, width = around.shape
    parts = (max(width // _PART_PX, 1), max(height // _PART_PX, 1))
    sums = np.pad(cv2.resize(around, parts, interpolation=cv2.INTER_AREA), _PARTS // 2, mode="edge")
    nearby = np.lib.stride_tricks.sliding_window_view(sums, (_PARTS, _PARTS))
    quiet = np.quantile(nearby, _QUIETER, axis=(2, 3)).astype(np.float32)
    return np.ascontiguousarray(cv2.resize(quiet, (width, height)))
