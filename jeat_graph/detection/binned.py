"""Events, piece by piece, into bins and windows: what detectors of events have in common."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.detection.noise import NoiseFilter
from jeat_graph.detection.settings import EventSettings
from jeat_graph.detection.windows import EventBins

_US_PER_S = 1e6


class Signal(NamedTuple):
    """Events without noise.

    Attributes:
        events: what is left.
        first_us: time of the first event with noise (µs).
        last_us: time of the last one (µs).
    """

    events: EventArray
    first_us: int
    last_us: int


class BinnedDetector:
    """Turns events into scans, one each step; what a scan holds, `_next_scan` says.

    Args:
        size_px: width and height of the picture.
        sensor: name of the sensor in the scans.
        rate_hz: scans per second.
        bins: the window.
        filled_bins: bins that must be full before the first scan.
        settings: noise, and the longest gap.
    """

    def __init__(
        self,
        size_px: tuple[int, int],
        sensor: str,
        rate_hz: float,
        bins: EventBins,
        filled_bins: int,
        settings: EventSettings,
    ) -> None:
        self.size_px, self.sensor = size_px, sensor
        self._bins = bins
        self._step_bins = round(_US_PER_S / (rate_hz * bins.bin_us))
        self._filled_bins = filled_bins
        self._longest_gap_us = settings.longest_gap_s * _US_PER_S
        self._noise = NoiseFilter(size_px, settings.noise)
        self._rest = EventArray.empty()
        self._last_us: int | None = None
        self._begun = False
        self._until_scan = 0

    def push(self, events: EventArray) -> list[Scan]:
        """Take events that follow those before, and return the scans that they complete.

        Args:
            events: any number, of any length of time.

        Raises:
            DataError: they begin before the last ones.
        """
        return self.scans_of(self.without_noise(events))

    def without_noise(self, events: EventArray) -> Signal | None:
        """Do the first half of `push`, which another thread may do ahead of `scans_of`; arguments as `push`.

        Returns:
            What `scans_of` takes; None of no events.

        Raises:
            DataError: they begin before the last ones.
        """
        if not len(events):
            return None
        first_us, last_us = int(events.t_us[0]), int(events.t_us[-1])
        if self._last_us is not None and first_us < self._last_us:
            raise DataError(f"events begin at {first_us} µs, before the last ones at {self._last_us} µs")
        self._last_us = last_us
        signal = EventArray.trusted(events.t_us, events.x, events.y, events.polarity)
        if self._noise.settings.alone or self._noise.settings.hot_pixels:
            signal = self._noise.keep(signal)
        return Signal(signal, first_us, last_us)

    def scans_of(self, signal: Signal | None) -> list[Scan]:
        """Return the scans that are complete with the next events."""
        if signal is None:
            return []
        events, first_us, last_us = signal
        if not self._begun:
            self._begun = True
            self._begin(first_us)
        waiting = _joined(self._rest, events)
        times = waiting.t_us
        scans: list[Scan] = []
        first = 0
        # A bin is complete when an event behind it is there.
        while self._bins.end_us + self._bins.bin_us <= last_us:
            next_us = int(times[first]) if first < len(times) else last_us
            if next_us - self._bins.end_us > self._longest_gap_us:
                self._begin(next_us)
                continue
            end = int(np.searchsorted(times, self._bins.end_us + self._bins.bin_us))
            scans += self._advance(_rows(waiting, slice(first, end)))
            first = end
        self._rest = _rows(waiting, slice(first, None))
        return scans

    def finish(self) -> list[Scan]:
        """Return the scan of the last, incomplete bin, if one is due; nothing may be pushed afterwards."""
        if not len(self._rest):
            return []
        rest, self._rest = self._rest, EventArray.empty()
        return self._advance(rest)

    def _next_scan(self) -> Scan:
        """Return the scan of the window as it is."""
        raise NotImplementedError

    def _emptied(self) -> None:
        """Forget what was before: a new recording begins, or time has leapt."""

    def _begin(self, first_us: int) -> None:
        """Let scans end at whole multiples of a step, whatever the first event's time."""
        number = first_us // self._bins.bin_us
        self._bins.skip_to(number * self._bins.bin_us)
        self._until_scan = self._step_bins - number % self._step_bins
        while self._until_scan < self._filled_bins:  # nothing is reported of a window that is not full
            self._until_scan += self._step_bins
        self._emptied()

    def _advance(self, events: EventArray) -> list[Scan]:
        self._bins.advance(events)
        self._until_scan -= 1
        if self._until_scan:
            return []
        self._until_scan = self._step_bins
        return [self._next_scan()]


def _rows(events: EventArray, rows: slice) -> EventArray:
    """Return some rows, without a look at their order."""
    return EventArray.trusted(events.t_us[rows], events.x[rows], events.y[rows], events.polarity[rows])


def _joined(a: EventArray, b: EventArray) -> EventArray:
    """Put two arrays together that follow one another."""
    if not len(a):
        return b
    return EventArray.trusted(
        np.concatenate([a.t_us, b.t_us]),
        np.concatenate([a.x, b.x]),
        np.concatenate([a.y, b.y]),
        np.concatenate([a.polarity, b.polarity]),
    )
