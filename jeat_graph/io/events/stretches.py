"""Stretches of time of any file of events, mostly forwards: what drawing asks for, picture by picture."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Protocol, Self

from jeat_graph.data.events import EventArray
from jeat_graph.io.events.dsec import DSEC_SIZE, DsecReader, check_assumed
from jeat_graph.io.events.dsec_hdf5 import EventFile
from jeat_graph.io.events.layout import EventLayout
from jeat_graph.io.events.opening import open_events
from jeat_graph.io.events.reader import Damage, EventReader


class Stretches(Protocol):
    """A file of events that can be asked for any time.

    Attributes:
        size_px: width and height of the picture.
        duration_us: time of the last event + 1, or longer if the file says so (µs).
        t_offset_us: what to add to the events' times for the clock of frames (µs).
        origin_us: time 0 on the clock that the file gives times by (µs).
    """

    t_offset_us: int
    origin_us: int

    @property
    def size_px(self) -> tuple[int, int] | None:
        """Width and height."""
        ...

    @property
    def duration_us(self) -> int:
        """Time of the last event + 1 (µs)."""
        ...

    def between(self, start_us: int, end_us: int) -> EventArray:
        """Return the events with `start_us` <= t < `end_us`."""
        ...

    def notes(self) -> list[str]:
        """Return what is known to be wrong with the file, one line for each."""
        ...


class IndexedStretches(EventFile):
    """HDF5 in the layout of DSEC, by its index.

    Args:
        path: the file.
        size_px: width and height of the picture; by default as the file says, else that of DSEC.

    Raises:
        DataError: it cannot be read.
    """

    origin_us = 0

    def __init__(self, path: Path, size_px: tuple[int, int] | None = None) -> None:
        super().__init__(path)
        size = size_px or self.size_px
        self._assumed = size is None
        self.size_px = size or DSEC_SIZE

    def rows(self, first: int, end: int, labels: bool = True) -> EventArray:
        """Read events by number; see `EventFile.rows`.

        Raises:
            DataError: as there, or events lie outside the picture of DSEC, which was assumed.
        """
        events = super().rows(first, end, labels)
        if self._assumed:
            check_assumed(events, self.path)
        return events

    def notes(self) -> list[str]:
        """Return nothing: what is wrong with such a file is an error."""
        return []


class ForwardStretches:
    """Reads a file forwards and keeps what may still be asked for; a step back reads it from the start.

    Args:
        path: the file; the others, and errors, as of `open_stretches`.
    """

    def __init__(
        self,
        path: str | Path,
        size_px: tuple[int, int] | None = None,
        layout: EventLayout | None = None,
        beside_px: tuple[int, int] | None = None,
    ) -> None:
        self._open = partial(open_events, path, size_px, layout)
        self._reader: EventReader = self._open()
        self._whole: Damage | None = None
        self._pieces: Iterator[EventArray] = self._reader.pieces()
        self._held = EventArray.empty()
        self._from_us = -(1 << 62)
        self._duration_us: int | None = None
        self.size_px = self._reader.needed_size(beside_px=beside_px)
        self._assumed = self._reader.damage.assumed
        self.t_offset_us = self._reader.t_offset_us
        self.origin_us = self._reader.origin_us

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
            with self._open() as reader:
                reader.size_px = self.size_px
                for piece in reader.pieces():
                    last = int(piece.t_us[-1]) if len(piece) else last
                self._whole = reader.damage
            self._duration_us = last + 1
        return self._duration_us

    def notes(self) -> list[str]:
        """Return what is known to be wrong with the file, one line for each."""
        damage = self._whole or self._reader.damage
        damage.assumed = self._assumed
        return damage.notes()

    def between(self, start_us: int, end_us: int) -> EventArray:
        """Return the events with `start_us` <= t < `end_us`.

        Raises:
            DataError: the file is damaged.
        """
        if start_us < self._from_us:
            self._reader.close()
            self._reader = self._open()
            self._reader.size_px = self.size_px
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


def open_stretches(
    path: str | Path,
    size_px: tuple[int, int] | None = None,
    layout: EventLayout | None = None,
    beside_px: tuple[int, int] | None = None,
) -> IndexedStretches | ForwardStretches:
    """Open a file of events for any time; HDF5 of DSEC has an index, others are read forwards.

    Args:
        path: the file.
        size_px: width and height of the picture, where the file does not say.
        layout: columns, unit of time and recording, where the file leaves that open.
        beside_px: width and height of frames of the same scene, taken if nothing says the size and events lie
            in them.

    Raises:
        ConfigError: an extra package is needed for this format.
        DataError: it cannot be read.
    """
    with open_events(path, size_px, layout) as reader:
        indexed = isinstance(reader, DsecReader)
    if indexed:
        return IndexedStretches(Path(path), size_px)
    return ForwardStretches(path, size_px, layout, beside_px)
