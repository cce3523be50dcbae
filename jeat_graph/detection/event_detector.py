"""Finds what moves in the events of a camera that stands still; needs no training.

Where nothing else moves, the events of a vehicle are a cloud in space and time. At each step the events of
the last `window_s` are linked where they lie near one another, and each cloud of enough events is a
detection. Its extent is taken from the newest part of the window, `extent_s` long, because a cloud of the
whole window is longer than the vehicle by what it travelled meanwhile; what it travels in that part is taken
off.

A detection is of the middle of that newest part: that is the time of its scan. The detector knows of it
`extent_s` / 2 later.
"""

from __future__ import annotations

import math

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.detection.components import Components, linked, measured, without_inner
from jeat_graph.detection.memory import CloudMemory
from jeat_graph.detection.noise import NoiseFilter
from jeat_graph.detection.settings import EventSettings
from jeat_graph.detection.windows import EventBins

_US_PER_S = 1e6


class EventDetector:
    """Turns events, given piece by piece, into scans.

    Args:
        size_px: width and height of the picture.
        sensor: name of the sensor in the scans.
        settings: how.
    """

    def __init__(
        self, size_px: tuple[int, int], sensor: str = "evt", settings: EventSettings | None = None
    ) -> None:
        self.sensor = sensor
        self.settings = settings or EventSettings()
        self._bins = EventBins(size_px, self.settings.bins(self.settings.window_s), self.settings.bin_s)
        self._noise = NoiseFilter(size_px, self.settings.noise)
        self._link_px = max(1, round(self.settings.link_share * math.hypot(*size_px)))
        steps = max(1, round(self.settings.apart_s * self.settings.rate_hz))
        self._memory = CloudMemory(self._link_px, steps)
        self._rest = EventArray.empty()
        self._begun = False
        self._until_scan = 0

    def push(self, events: EventArray) -> list[Scan]:
        """Take events that follow those before, and return the scans that they complete.

        Args:
            events: any number, of any length of time.

        Raises:
            DataError: they begin before the last ones.
        """
        if not len(events):
            return []
        if len(self._rest) and events.t_us[0] < self._rest.t_us[-1]:
            raise DataError(f"events begin at {events.t_us[0]} µs, before the last ones")
        if not self._begun:
            self._begin(int(events.t_us[0]))
        elif int(events.t_us[0]) < self._bins.end_us:
            raise DataError(f"events begin at {events.t_us[0]} µs, before the last ones")
        signal = self._noise.keep(EventArray.trusted(events.t_us, events.x, events.y, events.polarity))
        waiting = EventArray.concatenate([self._rest, signal])
        scans: list[Scan] = []
        # A bin is complete when an event behind it is there.
        last = int(events.t_us[-1])
        first = 0
        times = waiting.t_us
        while self._bins.end_us + self._bins.bin_us <= last:
            self._leap(int(times[first]) if first < len(times) else last)
            if self._bins.end_us + self._bins.bin_us > last:
                break
            end = int(np.searchsorted(times, self._bins.end_us + self._bins.bin_us))
            scans += self._advance(waiting.take(slice(first, end)))
            first = end
        self._rest = waiting.take(slice(first, None))
        return scans

    def finish(self) -> list[Scan]:
        """Return the scan of the last, incomplete bin, if one is due; nothing may be pushed afterwards."""
        if not len(self._rest):
            return []
        rest, self._rest = self._rest, EventArray.empty()
        return self._advance(rest)

    def _begin(self, first_us: int) -> None:
        """Let scans end at whole multiples of a step, whatever the first event's time."""
        step = self.settings.bins(1.0 / self.settings.rate_hz)
        bin_us = self._bins.bin_us
        number = first_us // bin_us
        self._bins.skip_to(number * bin_us)
        self._until_scan = step - number % step
        # Nothing is said of a window that is not full yet.
        while self._until_scan < self.settings.bins(self.settings.window_s):
            self._until_scan += step
        self._begun = True

    def _leap(self, next_us: int) -> None:
        gap = next_us - self._bins.end_us
        if gap > self.settings.longest_gap_s * _US_PER_S:
            self._begin(next_us)

    def _advance(self, events: EventArray) -> list[Scan]:
        self._bins.advance(events)
        self._until_scan -= 1
        if self._until_scan:
            return []
        self._until_scan = self.settings.bins(1.0 / self.settings.rate_hz)
        return [self._scan()]

    def _scan(self) -> Scan:
        settings = self.settings
        found = self._clouds()
        t = self._bins.end_us / _US_PER_S - settings.extent_s / 2.0
        scores = 1.0 - np.exp(-found.weight / settings.certain_events)
        return Scan(t, self.sensor, self._unsmeared(found.boxes), scores)

    def _unsmeared(self, boxes: FloatArray) -> FloatArray:
        """Take off what a box is too long because its events are of some time; the centre stays."""
        settings = self.settings
        smear = np.abs(self._memory.velocity) * settings.rate_hz * settings.extent_s
        side = np.maximum(boxes[:, 2:] - smear, np.minimum(boxes[:, 2:], settings.least_side_px))
        return np.column_stack([boxes[:, :2] + (boxes[:, 2:] - side) / 2.0, side])

    def _clouds(self) -> Components:
        """Link the window's events; boxes from the newest part, weights from all."""
        settings = self.settings
        total = self._bins.total
        count, labels = linked(total, self._link_px)
        whole = measured(count, labels, total)
        enough = whole.weight >= settings.least_events
        if not enough.any():
            return whole.take(enough)
        labels = _kept(labels, enough)
        count, labels = self._memory.relabel(labels, total)
        whole = measured(count, labels, total, keep_empty=True)
        newest = self._bins.recent(settings.bins(settings.extent_s))
        recent = measured(count, labels, newest, keep_empty=True)
        seen = (recent.pixels > 0) & (recent.boxes[:, 2:] >= settings.least_side_px).all(axis=1)
        found = Components(recent.boxes, whole.weight, recent.pixels).take(seen)
        found = found.take(without_inner(found, settings.inside_share))
        self._memory.remember(found.boxes)
        return found


def _kept(labels: np.ndarray[tuple[int, int], np.dtype[np.int32]], keep: np.ndarray) -> np.ndarray:
    """Number the kept groups anew, and take the others away."""
    number = np.zeros(len(keep) + 1, dtype=np.int32)
    number[1:][keep] = np.arange(1, int(keep.sum()) + 1)
    return number[labels]
