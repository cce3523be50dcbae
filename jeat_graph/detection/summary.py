"""What is in a file of events, in numbers: `jeat-graph events info`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from jeat_graph.data.events import EventArray
from jeat_graph.detection.noise import NoiseFilter, NoiseSettings
from jeat_graph.io.events.message_clock import Stamps
from jeat_graph.io.events.reader import EventReader, Triggers
from jeat_graph.io.events.trigger_times import EdgeCounts, count_edges

_US_PER_S = 1e6
#: Side of the picture that is assumed while the file's is not known (px).
_LARGEST = 2048


class EventSummary(NamedTuple):
    """Numbers of one recording.

    Attributes:
        format_name: what the file is.
        size_px: width and height of the picture.
        size_known: whether the file, or the user, says the size; else it is as far as the events reach.
        events: number of events.
        triggers: number of edges of external signals.
        first_s: time of the first event (s).
        duration_s: from the first to the last event (s).
        share_on: of the events, those where it became brighter.
        noise_hz_px: events that stand alone, in a second and pixel (see `noise`).
        hot_pixels: pixels that were hot at the end of the recording.
        hottest_hz: rate of the pixel with most events (Hz).
        notes: what was wrong with the file, one line each.
        origin_s: time 0 on the clock of the file (s), where it says one.
        edges: of the triggers, by channel, how many rose and how many fell.
        stamps: what the stamps of messages and the camera's own clock say, where the file has both.
    """

    format_name: str
    size_px: tuple[int, int]
    size_known: bool
    events: int
    triggers: int
    first_s: float
    duration_s: float
    share_on: float
    noise_hz_px: float
    hot_pixels: int
    hottest_hz: float
    notes: list[str]
    origin_s: float = 0.0
    edges: Mapping[str, EdgeCounts] = {}
    stamps: Stamps | None = None

    @property
    def rate_hz(self) -> float:
        """Events per second."""
        return self.events / self.duration_s if self.duration_s else 0.0

    def lines(self) -> list[str]:
        """Return the summary as text."""
        width, height = self.size_px
        known = "" if self.size_known else " (not declared; so far the events reach)"
        return [
            f"format: {self.format_name}",
            f"picture: {width} x {height} px{known}",
            f"events: {self.events}, {100.0 * self.share_on:.1f} % of them ON",
            f"time: from {self.first_s:.6f} s, {self.duration_s:.6f} s long",
            *([f"clock: time 0 is {self.origin_s:.6f} s of the file's clock"] if self.origin_s else []),
            f"rate: {self.rate_hz / _US_PER_S:.4g} million events/s",
            f"noise: {self.noise_hz_px:.3g} Hz/px stand alone",
            f"hot pixels: {self.hot_pixels}; the most active one fires at {self.hottest_hz:.4g} Hz",
            *([self.stamps.line()] if self.stamps else []),
            f"triggers: {self.triggers}",
            *(
                f"triggers of channel {channel}: {one.rising} rise, {one.falling} fall"
                for channel, one in self.edges.items()
            ),
            *(f"note: {note}" for note in self.notes),
        ]


def summarise(reader: EventReader, advance: Callable[[int], object] = lambda _: None) -> EventSummary:
    """Read a file of events once and count.

    Args:
        reader: the file.
        advance: called with the number of events that have been read since the last call.

    Raises:
        DataError: it cannot be read.
    """
    size = reader.size_px or (_LARGEST, _LARGEST)
    noise = NoiseFilter(size, NoiseSettings())
    counts = np.zeros(size[0] * size[1], dtype=np.int64)
    events = on = 0
    edges: list[Triggers] = []
    first = last = None
    for piece in reader.pieces():
        edges.append(reader.triggers)
        if reader.size_px is None:
            piece = _within(piece, reader)
        if not len(piece):
            continue
        first = int(piece.t_us[0]) if first is None else first
        last = int(piece.t_us[-1])
        events += len(piece)
        on += int(np.count_nonzero(piece.polarity))
        counts += np.bincount(piece.y.astype(np.int64) * size[0] + piece.x, minlength=len(counts))
        noise.signal(piece)
        advance(len(piece))
    picture = counts.reshape(size[1], size[0])
    duration_s = 0.0 if first is None or last is None else (last - first) / _US_PER_S
    known = reader.size_px is not None
    shown = size if known else _reach(picture)
    per_second = 1.0 / duration_s if duration_s else 0.0
    return EventSummary(
        format_name=reader.format_name,
        size_px=shown,
        size_known=known,
        events=events,
        triggers=sum(len(part.t_us) for part in edges),
        first_s=(first or 0) / _US_PER_S,
        duration_s=duration_s,
        share_on=on / events if events else 0.0,
        noise_hz_px=noise.alone * per_second / max(shown[0] * shown[1], 1),
        hot_pixels=int(noise.hot.sum()),
        hottest_hz=float(counts.max()) * per_second,
        notes=reader.damage.notes(),
        origin_s=(reader.origin_us + reader.t_offset_us) / _US_PER_S,
        edges=count_edges(Triggers.joined(edges)),
        stamps=reader.stamps,
    )


def _within(piece: EventArray, reader: EventReader) -> EventArray:
    """Leave out events that no camera has, where nothing says how large the picture is."""
    inside = (piece.x < _LARGEST) & (piece.y < _LARGEST)
    outside = len(piece) - int(inside.sum())
    reader.damage.outside += outside
    return piece.take(inside) if outside else piece


def _reach(picture: np.ndarray[tuple[int, int], np.dtype[np.int64]]) -> tuple[int, int]:
    rows, columns = np.flatnonzero(picture.any(axis=1)), np.flatnonzero(picture.any(axis=0))
    return (int(columns[-1]) + 1, int(rows[-1]) + 1) if len(rows) else (0, 0)
