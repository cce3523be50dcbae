"""AEDAT 4, iniVation's format of events, frames and triggers in one file, through the package `aedat`.

Times in the file count from 1970. Here they count from the first frame or event, whichever is earlier, the
same for both, so that frames and events of one file share a clock; `origin_us` leads back.
Source: https://docs.inivation.com/software/software-advanced-usage/file-formats/aedat-4.0.html
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import IntArray
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.data.events import EventArray
from jeat_graph.data.extras import install
from jeat_graph.io.events.ascending import Ascending
from jeat_graph.io.events.reader import PIECE_ROWS, EventReader, Triggers, agreed_size

MAGIC = b"#!AER-DAT4"
#: Packets that are looked through for the first frame and the first event.
_SEARCHED = 1000
_KINDS = ("events", "frame")
_NO_LIMIT = 1 << 16
# Kinds of triggers: 1 a signal rises, 2 it falls, 3 a pulse; 4 and 5 of the generator; a frame begins 6 and
# ends 7, its exposure 8 and 9; 0 a reset of the clock. These end what the number before begins.
_ENDS = (2, 5, 7, 9)


class Aedat4Reader(EventReader):
    """Reads the events of AEDAT 4.

    Args:
        path: the file.
        size_px: width and height of the picture; by default as the file says.

    Raises:
        ConfigError: the package `aedat` is not installed.
        DataError: the file cannot be read, or has no events.
    """

    format_name = "AEDAT4"

    def __init__(self, path: Path, size_px: tuple[int, int] | None) -> None:
        streams = streams_of(path)
        if "events" not in streams:
            raise DataError(f"holds no events, only {', '.join(sorted(streams)) or 'nothing'}", path)
        super().__init__(path, agreed_size(size_px, streams["events"], path))
        self.origin_us = origin_us(path)

    def pieces(self) -> Iterator[EventArray]:
        """Yield all events in the order of their times, packet by packet.

        Raises:
            DataError: the file is damaged.
        """
        width, height = self.size_px or (_NO_LIMIT, _NO_LIMIT)
        edges: list[Triggers] = []
        ascending = Ascending(self.damage)
        for packet in self._packets():
            if "triggers" in packet:
                rows = packet["triggers"]
                t = rows["t"].astype(np.int64) - self.origin_us
                edges.append(_edges(t, rows["source"].astype(np.uint8)))
                continue
            rows = packet["events"]
            inside = (rows["x"] < width) & (rows["y"] < height)
            self.damage.outside += int((~inside).sum())
            t = rows["t"].astype(np.int64)[inside] - self.origin_us
            if not len(t):
                continue
            t = ascending(t)
            self.damage.events += len(t)
            whole = EventArray(t, rows["x"][inside], rows["y"][inside], rows["on"][inside].astype(np.uint8))
            for first in range(0, len(whole), PIECE_ROWS):
                self.triggers, edges = Triggers.joined(edges), []
                yield whole.take(slice(first, first + PIECE_ROWS))
        if edges:
            self.triggers = Triggers.joined(edges)
            yield EventArray.empty()

    def _packets(self) -> Iterator[Any]:
        """Packets of events and triggers; a file that is cut off ends with a note of it."""
        found = 0
        try:
            for packet in packets_of(self.path):
                if "events" in packet or "triggers" in packet:
                    found += "events" in packet
                    yield packet
        except DataError as error:
            if not found:
                raise
            self.damage.unfinished = f"it was read only up to a damaged packet: {error.message}"


def _edges(t_us: IntArray, source: npt.NDArray[np.uint8]) -> Triggers:
    """Return triggers, the two kinds of one signal as one channel: the number of the kind that begins."""
    ends = np.isin(source, _ENDS)
    return Triggers(t_us, np.where(ends, source - 1, source).astype(np.uint8), (~ends).astype(np.uint8))


def packets_of(path: Path) -> Iterator[Any]:
    """Yield the packets of a file as the package `aedat` decodes them.

    Raises:
        ConfigError: the package `aedat` is not installed.
        DataError: the file, or a packet, cannot be read.
    """
    decoder = _decoder(path)
    while True:
        try:
            packet = next(decoder)
        except StopIteration:
            return
        except BaseException as error:  # the package's own errors, and panics, which are no `Exception`
            raise _as_data_error(error, path) from None
        yield packet


def streams_of(path: Path) -> dict[str, tuple[int, int] | None]:
    """Return the kinds of streams in a file (`events`, `frame`, `triggers`, `imus`), with their sizes (px).

    Raises:
        ConfigError: the package `aedat` is not installed.
        DataError: the file cannot be read.
    """
    try:
        streams = _decoder(path).id_to_stream()
    except (ConfigError, DataError):
        raise
    except BaseException as error:
        raise _as_data_error(error, path) from None
    found: dict[str, tuple[int, int] | None] = {}
    for stream in streams.values():
        size = (int(stream["width"]), int(stream["height"])) if "width" in stream else None
        found.setdefault(str(stream["type"]), size)
    return found


def origin_us(path: Path) -> int:
    """Return the time of the first frame or event, on the clock of the file (µs).

    Raises:
        DataError: the file cannot be read.
    """
    wanted = {kind for kind in streams_of(path) if kind in _KINDS}
    first: dict[str, int] = {}
    for k, packet in enumerate(packets_of(path)):
        if "events" in packet and len(packet["events"]):
            first.setdefault("events", int(packet["events"]["t"][0]))
        if "frame" in packet:
            first.setdefault("frame", int(packet["frame"]["t"]))
        if first.keys() >= wanted or k >= _SEARCHED:
            break
    return min(first.values(), default=0)


def _decoder(path: Path) -> Any:
    try:
        import aedat
    except ImportError:
        raise ConfigError(f"AEDAT4 files need {install('aedat4')}") from None
    try:
        return aedat.Decoder(str(path))
    except BaseException as error:
        raise _as_data_error(error, path) from None


def _as_data_error(error: BaseException, path: Path) -> BaseException:
    """Turn an error of the package into one of ours; what asks us to stop stays as it is."""
    if isinstance(error, KeyboardInterrupt | SystemExit | GeneratorExit):
        return error
    return DataError(f"cannot be read as AEDAT4: {' '.join(str(error).split())[:200]}", path)
