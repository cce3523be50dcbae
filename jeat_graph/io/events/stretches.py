"""Stretches of time of any file of events, mostly forwards: what drawing asks for, picture by picture."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Protocol, Self

from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.io.events.opening import open_events
from jeat_graph.io.events.reader import EventReader
from jeat_graph.io.events_dsec import EventFile

_HDF5 = b"\x89HDF"


class Stretches(Protocol):
    """A file of events that can be asked for any time.

    Attributes:
        size_px: width and height of the picture, or None if the file does not say.
        duration_us: time of the last event + 1, or longer if the file says so (µs).
        t_offset_us: what to add to the events' times for the clock of frames (µs).
    """

    @property
    def size_px(self) -> tuple[int, int] | None:
        """Width and height."""

    @property
    def duration_us(self) -> int:
        """Time of the last event + 1 (µs)."""

    @property
    def t_offset_us(self) -> int:
        """What to add to the events' times (µs)."""

    def between(self, start_us: int, end_us: int) -> EventArray:
        """Return the events with `start_us` <= t < `end_us`."""


class ForwardStretches:
    """Reads a file forwards and keeps what may still be asked for; a step back reads it anew.

    Args:
        path: the file.

    Raises:
        ConfigError: an extra package is needed for this format.
        DataError: it cannot be read.
    """

    def __init__(self, path: str | Path) -> None:
        self._path = path
        self._reader: EventReader = open_events(path)
        self._pieces: Iterator[EventArray] = self._reader.pieces()
        self._held = EventArray.empty()
        self._from_us = -(1 << 62)
        self._duration_us: int | None = None
        self.size_px = self._reader.size_px
        self.t_offset_us = self._reader.t_offset_us

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._reader.close()

    @property
    def duration_us(self) -> int:
        """Time of the last event + 1 (µs); the whole file is read for it, once."""
        if self._duration_us is None:
            last = -1
            with open_events(self._path) as reader:
                for piece in reader.pieces():
                    last = int(piece.t_us[-1]) if len(piece) else last
            self._duration_us = last + 1
        return self._duration_us

    def between(self, start_us: int, end_us: int) -> EventArray:
        """Return the events with `start_us` <= t < `end_us`.

        Raises:
            DataError: the file is damaged.
        """
        if start_us < self._from_us:
            self._reader.close()
            self._reader = open_events(self._path)
            self._pieces = self._reader.pieces()
            self._held = EventArray.empty()
        self._from_us = start_us
        parts = [self._held.between(start_us, 1 << 62)]
        while not len(parts[-1]) or parts[-1].t_us[-1] < end_us:
            piece = next(self._pieces, None)
            if piece is None:
                break
            piece = EventArray.trusted(piece.t_us, piece.x, piece.y, piece.polarity)
            parts.append(piece.between(start_us, 1 << 62))
        self._held = EventArray.concatenate(parts)
        return self._held.between(start_us, end_us)


def open_stretches(path: str | Path) -> EventFile | ForwardStretches:
    """Open a file of events for any time; HDF5 of DSEC has an index, others are read forwards.

    Raises:
        ConfigError: an extra package is needed for this format.
        DataError: it cannot be read.
    """
    place = Path(path)
    try:
        with place.open("rb") as file:
            indexed = file.read(len(_HDF5)) == _HDF5
    except OSError:
        indexed = False
    if indexed:
        try:
            return EventFile(place)
        except DataError as error:
            if "is missing" not in error.message:
                raise
    return ForwardStretches(place)
