"""From one file of events to another, piece by piece: `jeat-graph events convert`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.io.events.reader import EventReader

#: Formats that are written, by the suffix that asks for them; the first of a suffix is its default.
WRITTEN = {"evt3": ".raw", "evt2": ".raw", "dat": ".dat", "hdf5": ".h5"}
SUFFIXES = {".raw": "evt3", ".dat": "dat", ".h5": "hdf5", ".hdf5": "hdf5"}


def event_writer(path: Path, fmt: str | None, size_px: tuple[int, int], origin_us: int = 0) -> Any:
    """Return the writer of a format, to be entered.

    Args:
        path: the file to be.
        fmt: one of `WRITTEN`; None chooses by the suffix.
        size_px: width and height of the picture.
        origin_us: time 0 on the clock of the recording (µs): `t_offset` of HDF5, a line of other headers.

    Raises:
        DataError: the suffix tells no format, or not this one.
    """
    from jeat_graph.io.events.dat_writer import DatWriter
    from jeat_graph.io.events.dsec_writer import EventWriter
    from jeat_graph.io.events.evt2_writer import Evt2Writer
    from jeat_graph.io.events.evt3_writer import Evt3Writer

    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise DataError(f"must end in {', '.join(SUFFIXES)}: these formats of events are written", path)
    name = fmt or SUFFIXES[suffix]
    if WRITTEN[name] != WRITTEN[SUFFIXES[suffix]]:
        raise DataError(f"{name} is written to files that end in {WRITTEN[name]}", path)
    if name == "hdf5":
        return EventWriter(path, size_px, t_offset_us=origin_us)
    return {"evt2": Evt2Writer, "evt3": Evt3Writer, "dat": DatWriter}[name](path, size_px, origin_us)


def convert(
    reader: EventReader,
    path: Path,
    fmt: str | None = None,
    on_events: Callable[[int], object] = lambda _: None,
) -> int:
    """Write the events of a reader into another file.

    Times are those that the reader gives; what leads from them to the clock of the recording is kept, as
    `t_offset` in HDF5 and in a line `% t_offset` of the headers of RAW and DAT. Triggers and labels are left
    behind.

    Args:
        reader: what to read.
        path: what to write; it appears when it is complete.
        fmt: one of `WRITTEN`; by default as the suffix says.
        on_events: called with the number of each piece's events.

    Returns:
        The number of events.

    Raises:
        DataError: nothing says the size of the picture, or something cannot be read or written.
    """
    count = 0
    origin_us = reader.t_offset_us + reader.origin_us
    with event_writer(path, fmt, reader.needed_size("--size"), origin_us) as writer:
        for piece in reader.pieces():
            writer.append(EventArray.trusted(piece.t_us, piece.x, piece.y, piece.polarity))
            count += len(piece)
            on_events(len(piece))
    return count
