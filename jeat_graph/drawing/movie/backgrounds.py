"""Backgrounds of a movie, behind the tracks: frames of a video, accumulated events, or plain darkness."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.events import EventArray
from jeat_graph.drawing.palette import BRIGHTER, DARK, DARKER
from jeat_graph.io.events.stretches import Stretches
from jeat_graph.io.media.video import FrameSource, RgbImage

# Events of one pixel at which its colour has come two thirds of the way (1 − 1/e).
_SATURATION = 1.0
_US_PER_S = 1e6
_TOLERANCE_S = 1e-6


class FilmBackground(Protocol):
    """Pictures by time.

    Attributes:
        name: what the picture is, in a word.
        size_px: width and height.
    """

    name: str
    size_px: tuple[int, int]

    def image(self, t: float) -> RgbImage:
        """Return the picture (H, W, 3) at time `t` (s); not to be changed."""
        ...


class PlainBackground:
    """The same dark picture at all times."""

    name = ""

    def __init__(self, size_px: tuple[int, int]) -> None:
        self.size_px = size_px
        self._image = np.full((size_px[1], size_px[0], 3), DARK, dtype=np.uint8)

    def image(self, t: float) -> RgbImage:
        """Return the dark picture."""
        return self._image


class VideoBackground:
    """Frames of a recording: at each time the last one taken, before the first the first."""

    name = "RGB"

    def __init__(self, source: FrameSource) -> None:
        self.size_px = source.size_px
        self.times_s: FloatArray = source.times_s
        self.path, self.missing = source.path, source.missing
        self._source = source

    def index(self, t: float) -> int:
        """Return the number of the frame that is shown at time `t` (s)."""
        return max(int(np.searchsorted(self.times_s, t + _TOLERANCE_S, side="right")) - 1, 0)

    def image(self, t: float) -> RgbImage:
        """Return the frame that is shown at time `t` (s)."""
        return self._source.frame(self.index(t))


class EventBackground:
    """Events of the last moment before each time, brighter ones warm and darker ones blue.

    Args:
        source: the file of events.
        window_s: how long events are shown (s).
    """

    name = "events"

    def __init__(self, source: Stretches, window_s: float) -> None:
        assert source.size_px is not None
        self.size_px = source.size_px
        self._source = source
        self._window_us = max(round(window_s * _US_PER_S), 1)
        offset = source.t_offset_us
        self._offset_us = offset

    @property
    def span_s(self) -> tuple[float, float]:
        """First and last time of the recording (s)."""
        return self._offset_us / _US_PER_S, (self._offset_us + self._source.duration_us) / _US_PER_S

    def image(self, t: float) -> RgbImage:
        """Return the events of the window that ends with time `t` (s)."""
        end = round(t * _US_PER_S) - self._offset_us + 1
        return accumulate(self._source.between(end - self._window_us, end), self.size_px)

    def notes(self) -> list[str]:
        """Say what of the file was left out."""
        return self._source.notes()


def accumulate(events: EventArray, size_px: tuple[int, int]) -> RgbImage:
    """Draw events: the more of one kind a pixel has, the more of that kind's colour.

    Args:
        events: the events; those outside the picture are passed over.
        size_px: width and height.

    Returns:
        (H, W, 3) uint8.
    """
    width, height = size_px
    inside = (events.x < width) & (events.y < height)
    place = events.y[inside].astype(np.int64) * width + events.x[inside]
    up = np.bincount(place[events.polarity[inside] > 0], minlength=width * height)
    down = np.bincount(place[events.polarity[inside] == 0], minlength=width * height)
    out = np.full((width * height, 3), DARK, dtype=np.uint8)
    hit = np.flatnonzero(up + down)
    total = (up + down)[hit].astype(np.float64)
    strength = (1.0 - np.exp(-total / _SATURATION))[:, None]
    share = (up[hit] / total)[:, None]
    colour = share * np.array(BRIGHTER) + (1.0 - share) * np.array(DARKER)
    out[hit] = np.rint((1.0 - strength) * np.array(DARK) + strength * colour)
    return out.reshape(height, width, 3)
