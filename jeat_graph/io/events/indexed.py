"""Long files of events that can be asked for any time at once: HDF5 with a column each, and DAT.

Data sets for learning hold hours of events, of which one stretch after the other is drawn at random. HDF5 has
an index by millisecond, or its times are searched by halving; so are the words of DAT, all of one length.
Times that run backwards by a little, as they do in recordings of Prophesee's cameras, are held.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.io.events.dat import DatReader
from jeat_graph.io.events.dsec_hdf5 import EventFile
from jeat_graph.io.events.raw_header import origin_of, read_raw_header

_HDF5 = b"\x89HDF\r\n\x1a\n"
_WORD = np.dtype("<u8")
_VERSIONS = ("0", "1", "2")
_TIME_BITS = np.uint64(0xFFFFFFFF)
#: Words that are looked at for a clock that begins again, evenly chosen.
_SAMPLED = 1000


class SearchedFile(EventFile):
    """HDF5 in columns without an index, as RVT and eTraM have it; times that run backwards are held.

    Args:
        path: the file.

    Raises:
        DataError: no such file, no HDF5, or a data set that is missing or of a wrong type or length.
    """

    def _ordered(self, t_us: IntArray) -> IntArray:
        """Return times that run on: what is earlier than one before has that one's time."""
        return np.asarray(np.maximum.accumulate(t_us))


class DatFile:
    """A DAT file that can be asked for any time; a context manager.

    Attributes:
        path: the file.
        size_px: width and height of the picture, or None if the file does not say.
        duration_us: time of the last event + 1 (µs).
        t_offset_us: what to add to the events' times for the clock of other files (µs).

    Args:
        path: the file.

    Raises:
        DataError: it is no DAT, or so long that its clock begins again.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        with self.path.open("rb") as file:
            header = read_raw_header(file, self.path)
            self._header_bytes = file.tell() + 2
            version = header.keys.get("version", "2").strip()
            if version not in _VERSIONS:
                raise DataError(f"is DAT of version {version!r}; 1 and 2 are read", self.path)
            self._version = int(version)
            # The reader checks the two bytes that announce the events.
            DatReader(self.path, file, header.size_px, self._version)
        self.size_px = header.size_px
        self.t_offset_us = origin_of(header, self.path)
        count = (self.path.stat().st_size - self._header_bytes) // _WORD.itemsize
        self._words: npt.NDArray[np.uint64] = (
            np.memmap(self.path, _WORD, "r", self._header_bytes, (count,)) if count else np.zeros(0, _WORD)
        )
        sampled = self._times(np.linspace(0, max(count - 1, 0), min(count, _SAMPLED)).astype(np.int64))
        if (np.diff(sampled) < -(1 << 31)).any():
            raise DataError("is so long that its clock begins again: convert it to .h5 first", self.path)
        self.duration_us = int(sampled[-1]) + 1 if count else 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the file."""
        self._words = np.zeros(0, _WORD)

    def between(self, start_us: int, end_us: int) -> EventArray:
        """Read the events with `start_us` <= t < `end_us`.

        Raises:
            DataError: what is read is not of DAT.
        """
        low, high = self._first_at(start_us), self._first_at(end_us)
        if high <= low:
            return EventArray.empty()
        head = bytes((12, _WORD.itemsize))
        file = io.BytesIO(head + self._words[low:high].tobytes())
        reader = DatReader(self.path, file, self.size_px, self._version)
        return EventArray.concatenate(list(reader.pieces())).between(start_us, end_us)

    def _times(self, rows: Any) -> IntArray:
        return np.asarray(self._words[rows] & _TIME_BITS, dtype=np.int64)

    def _first_at(self, t_us: int) -> int:
        """Return the number of the first event at or after a time, by halving."""
        low, high = 0, len(self._words)
        while low < high:
            middle = (low + high) // 2
            if int(self._times(middle)) < t_us:
                low = middle + 1
            else:
                high = middle
        return low


IndexedFile = EventFile | DatFile


def open_indexed(path: str | Path) -> IndexedFile | None:
    """Open a file of events for any time, or return None where it can only be read from its beginning.

    Raises:
        DataError: no such file, or one that is damaged.
    """
    place = Path(path)
    try:
        with place.open("rb") as file:
            start = file.read(len(_HDF5))
            if start[:1] == b"%":
                file.seek(0)
                return DatFile(place) if read_raw_header(file, place).encoding is None else None
    except OSError as error:
        raise DataError(f"cannot be read: {error.strerror or error}", place) from None
    return _open_hdf5(place) if start == _HDF5 else None


def _open_hdf5(place: Path) -> EventFile | None:
    import h5py

    from jeat_graph.io.events.hdf5_items import find_item, opening_error

    try:
        with h5py.File(place, "r") as file:
            columns = find_item(file, "events/t", place) is not None
            indexed = find_item(file, "ms_to_idx", place) is not None
    except OSError as error:
        raise opening_error(error, place) from None
    if not columns:
        return None
    return EventFile(place) if indexed else SearchedFile(place)
