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
from jeat_graph.data.events import EventArray
from jeat_graph.detection.background import UsualActivity
from jeat_graph.detection.binned import BinnedDetector
from jeat_graph.detection.components import Components, measured, weights, without_inner
from jeat_graph.detection.lamps import Lamps
from jeat_graph.detection.linking import MarkedPixels, linked, marked_pixels
from jeat_graph.detection.memory import CloudMemory
from jeat_graph.detection.settings import USUAL_RATE_HZ, EventSettings
from jeat_graph.detection.windows import EventBins

_US_PER_S = 1e6


class EventDetector(BinnedDetector):
    """Turns events, given piece by piece, into scans.

    Args:
        size_px: width and height of the picture.
        sensor: name of the sensor in the scans.
        settings: how.
    """

    def __init__(
        self, size_px: tuple[int, int], sensor: str = "evt", settings: EventSettings | None = None
    ) -> None:
        self.settings = settings or EventSettings()
        bins = self.settings.bins(self.settings.window_s)
        ring = EventBins(size_px, bins, self.settings.bin_s)
        self._rate_hz = self.settings.rate(USUAL_RATE_HZ)
        super().__init__(size_px, sensor, self._rate_hz, ring, bins, self.settings)
        self._background = UsualActivity(size_px, self._rate_hz, self.settings.background)
        diagonal = math.hypot(*size_px)
        self._steps = max(1, round(self.settings.apart_s * self._rate_hz))
        self._piece_steps = round(self.settings.pieces_s * self._rate_hz)
        self._near_px = max(2, round(self.settings.near_share * diagonal))
        self._memory = CloudMemory(self._near_px, self._steps, self._piece_steps)
        self._lamps = Lamps(size_px) if self.settings.lamps else None

    def _emptied(self) -> None:
        self._background.forget()
        self._memory = CloudMemory(self._near_px, self._steps, self._piece_steps)

    def _advance(self, events: EventArray) -> list[Scan]:
        if self._lamps is not None:
            self._lamps.watch(events)
        return super()._advance(events)

    def _next_scan(self) -> Scan:
        settings = self.settings
        found = self._clouds()
        t = self._bins.end_us / _US_PER_S - settings.extent_s / 2.0
        scores = 1.0 - np.exp(-found.weight / settings.certain_events)
        return Scan(t, self.sensor, self._unsmeared(found.boxes), scores)

    def _unsmeared(self, boxes: FloatArray) -> FloatArray:
        """Take off what a box is too long because its events are of some time; the centre stays."""
        settings = self.settings
        smear = np.abs(self._memory.velocity) * self._rate_hz * settings.extent_s
        side = np.maximum(boxes[:, 2:] - smear, np.minimum(boxes[:, 2:], settings.least_side_px))
        return np.column_stack([boxes[:, :2] + (boxes[:, 2:] - side) / 2.0, side])

    def _link_px(self, pixels: MarkedPixels) -> int:
        """Return the gap across which pixels belong together (px): narrow where the events are dense."""
        hit = len(pixels.x)
        per_pixel = pixels.total / hit if hit else 1.0
        return int(np.clip(round(self.settings.link_events / per_pixel), 2, self._near_px))

    def _clouds(self) -> Components:
        """Link the window's events; boxes from the newest part, weights from all."""
        settings = self.settings
        total = self._bins.total if self._lamps is None else self._lamps.without(self._bins.total)
        pixels = marked_pixels(self._background.standing_out(total))
        count, marked = linked(pixels, self._link_px(pixels), settings.least_events)
        count, marked = self._memory.relabel(count, marked)
        whole = weights(count, marked)
        newest = self._bins.recent(settings.bins(settings.extent_s), marked.y, marked.x)
        recent = measured(count, marked._replace(weight=newest), settings.trim_share, keep_empty=True)
        seen = (recent.pixels > 0) & (recent.boxes[:, 2:] >= settings.least_side_px).all(axis=1)
        found = Components(recent.boxes, whole, recent.pixels).take(seen)
        found = found.take(without_inner(found, settings.inside_share))
        self._memory.remember(found.boxes)
        return found
