"""Leaves out the noise of an event camera: events that stand alone, and pixels that fire all the time.

An edge that moves fires in several neighbouring pixels within a few milliseconds; noise fires in single ones.
An event with no other in the eight pixels around it within the last `support_s` is *background activity*. A
*hot pixel* fires faster than `hot_hz` over a second while the pixels around it do not.
Source of the first: Delbruck, "Frame-free dynamic digital vision" (2008).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jeat_graph.config.fields import Section, flag, number
from jeat_graph.core import detection as core
from jeat_graph.data.arrays import BoolArray
from jeat_graph.data.events import EventArray

_US_PER_S = 1e6
_LONG_AGO = -(1 << 62)
# Times of pixels are kept in 32 bits, from a beginning that follows: half of the memory, which is what the
# filter waits for. A pixel that never fired did so longest ago.
_NEVER = -(1 << 31)
_MOST_LATER_US = 1 << 30
_NEIGHBOURS = 8


@dataclass(frozen=True)
class NoiseSettings(Section):
    """What is taken for noise in events and left out."""

    alone: bool = flag(True, "whether events that stand alone are left out")
    support_s: float = number(
        0.03,
        "s",
        "an event stands alone if no pixel around it fired within this time before it; an edge of 100 px/s "
        "passes from pixel to pixel in 10 ms",
        0.0,
        1000.0,
        open_low=True,
    )
    hot_pixels: bool = flag(True, "whether pixels that fire all the time are left out")
    hot_hz: float = number(
        10.0,
        "Hz",
        "rate from which a pixel may be hot; an IMX636 indoors has .002 Hz/px, its hottest 10 Hz",
        open_low=True,
    )
    hot_ratio: float = number(
        8.0, "1", "a hot pixel fires so many times as often as those around it; an edge fires in all", 1.0
    )
    period_s: float = number(
        1.0, "s", "over which the rate of a pixel is taken; hot pixels are looked for again after each", 0.01
    )


class NoiseFilter:
    """Leaves out noise from events that come piece by piece.

    Args:
        size_px: width and height of the picture; events outside are left out.
        settings: what noise is.

    Attributes:
        hot: (H, W) pixels that are taken for hot now.
        alone: events that stood alone so far, those of hot pixels not counted.
    """

    def __init__(self, size_px: tuple[int, int], settings: NoiseSettings | None = None) -> None:
        width, height = size_px
        self.settings = settings or NoiseSettings()
        self.hot: BoolArray = np.zeros((height, width), dtype=bool)
        self.alone = 0
        # One pixel of margin, so that every pixel has eight around it.
        self._last = np.full((height + 2, width + 2), _NEVER, dtype=np.int32)
        self._begin_us = _LONG_AGO
        self._counts = np.zeros((height, width), dtype=np.int32)
        self._period_end = _LONG_AGO

    def keep(self, events: EventArray) -> EventArray:
        """Return the events that are not noise; the same ones where all are."""
        good = self.signal(events)
        if good.all():
            return events
        if events.by_motion is not None:
            return events.take(np.flatnonzero(good))
        return EventArray.trusted(*core.take_events(*events.contiguous(), good))

    def signal(self, events: EventArray) -> BoolArray:
        """Return which events (N,) are not noise."""
        settings = self.settings
        good: BoolArray = np.zeros(len(events), dtype=bool)
        period_us = round(settings.period_s * _US_PER_S)
        all_t = np.ascontiguousarray(events.t_us, np.int64)
        all_x, all_y = np.ascontiguousarray(events.x, np.uint16), np.ascontiguousarray(events.y, np.uint16)
        start = 0
        while start < len(events):
            if events.t_us[start] >= self._period_end:
                self._find_hot(settings.period_s if self._period_end > _LONG_AGO else 0.0)
                self._period_end = int(events.t_us[start]) + period_us
            self._follow(int(events.t_us[start]))
            last_us = min(self._period_end, self._begin_us + 2 * _MOST_LATER_US)
            end = int(np.searchsorted(events.t_us, last_us))
            rows = slice(start, max(end, start + 1))
            t, x, y = all_t[rows], all_x[rows], all_y[rows]
            if settings.hot_pixels:
                core.count_pixels(x, y, self._counts)
            if settings.alone:
                times = self._begin_us, round(settings.support_s * _US_PER_S)
                self.alone += core.judge_noise(t, x, y, self._last, self.hot, times, good[rows])
            else:
                core.leave_hot(x, y, self.hot, good[rows])
            start = rows.stop
        return good

    def _follow(self, now_us: int) -> None:
        """Let the beginning of the pixels' times follow, so that they fit in 32 bits."""
        later_us = now_us - self._begin_us
        if later_us > _MOST_LATER_US:
            moved = np.where(self._last == _NEVER, _NEVER, self._last.astype(np.int64) - later_us)
            self._last = np.maximum(moved, _NEVER).astype(np.int32)
            self._begin_us = now_us

    def _find_hot(self, period_s: float) -> None:
        if self.settings.hot_pixels and period_s > 0.0:
            padded = np.pad(self._counts, 1)
            around = sum(
                padded[1 + dy : padded.shape[0] - 1 + dy, 1 + dx : padded.shape[1] - 1 + dx]
                for dy in (-1, 0, 1)
                for dx in (-1, 0, 1)
                if dx or dy
            )
            often = self._counts >= self.settings.hot_hz * period_s
            self.hot = often & (self._counts * _NEIGHBOURS >= self.settings.hot_ratio * around)
        self._counts[:] = 0
