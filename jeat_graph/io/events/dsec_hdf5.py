"""Event files in the layout of the DSEC data set: HDF5 with one array a column and an index by millisecond.

======================  =====================================================================================
`events/x`, `events/y`  (N,) uint16 column and row (px)
`events/p`              (N,) uint8 polarity, 1 brighter, 0 darker
`events/t`              (N,) uint32 time (µs), not decreasing
`ms_to_idx`             (M,) uint64: the first event at or after `ms` milliseconds, for ms = 0, 1, …; where it
                        is missing, times are searched for in `events/t`
`t_offset`              int64: add to `events/t` for the time on the clock of other files (µs)
======================  =====================================================================================

Beyond DSEC, files written here have `events/by_motion` (N,) uint8 where the source knows what caused an
event, and the attributes `width`, `height` (px) and `duration_us`.
Source: https://github.com/uzh-rpg/DSEC, section "Events" of its README.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.io.events.hdf5_chunks import read_chunks
from jeat_graph.io.events.hdf5_items import (
    check_storage,
    find_item,
    opening_error,
    reading_error,
    single_item,
)
from jeat_graph.io.events.hdf5_tables import picture_size, whole_number

US_PER_MS = 1000
LABEL = "by_motion"
_COLUMNS = ("x", "y", "p", "t")
_PIECE_ROWS = 1 << 20
_MOST_MS = 24 * 3600 * 1000
_LATEST = 1 << 53  # µs; whole numbers up to here are exact as floats


class EventFile:
    """A file of events, read piece by piece; a context manager.

    Attributes:
        path: the file.
        size_px: width and height of the picture, or None if the file does not say (DSEC's own are 640 x 480).
        duration_us: length of the recording (µs); the last event's time + 1 if the file does not say.
        t_offset_us: what to add to the events' times for the clock of other files (µs).
        labelled: whether events say if motion or noise caused them.

    Args:
        path: the file.

    Raises:
        DataError: no such file, no HDF5, or a data set that is missing or of a wrong type or length.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._file = _open(self.path)
        try:
            self._events = self._columns()
            self._index = self._read_index()
            offset = single_item(self._file, "t_offset", self.path)
            self.t_offset_us = (
                0 if offset is None else whole_number("t_offset", offset, -_LATEST, _LATEST, self.path)
            )
            self.size_px = picture_size(self._file, "events", self.path)
            self.labelled = LABEL in self._events
            stored = self._attribute("duration_us", 0, _LATEST)
            last = int(self._read(self._events["t"], slice(len(self) - 1, None))[0]) + 1 if len(self) else 0
            self.duration_us = last if stored is None else max(stored, last)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __len__(self) -> int:
        return int(self._events["t"].shape[0])

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def between(self, start_us: int, end_us: int) -> EventArray:
        """Read the events with `start_us` <= t < `end_us`, times as in the file (without `t_offset_us`).

        Raises:
            DataError: times run backwards, or the index by millisecond is wrong.
        """
        low = self._index_at(max(start_us, 0) // US_PER_MS)
        high = self._index_at(-(-max(end_us, 0) // US_PER_MS))
        if high <= low:
            return EventArray.empty(self.labelled)
        part = self.rows(low, high)
        ms = max(start_us, 0) // US_PER_MS
        if part.t_us[0] < ms * US_PER_MS:
            raise DataError(f"ms_to_idx is wrong at {ms} ms: that event is earlier", self.path)
        return part.between(start_us, end_us)

    def rows(self, first: int, end: int, labels: bool = True) -> EventArray:
        """Read events by number, from `first` to before `end`.

        Args:
            first: number of the first.
            end: number behind the last.
            labels: whether to read what caused them, too, where it is known.

        Raises:
            DataError: times run backwards, or the data are damaged.
        """
        labels = labels and self.labelled
        names = [name for name in self._events if labels or name != LABEL]
        read = {name: self._read(self._events[name], slice(first, end)) for name in names}
        for name in ("x", "y"):
            if (
                read[name].dtype != np.uint16
                and len(read[name])
                and not 0 <= int(read[name].min()) <= int(read[name].max()) < 2**16
            ):
                raise DataError(f"events/{name}: negative or too large for 16 bits", self.path)
        try:
            return EventArray(
                self._ordered(read["t"].astype(np.int64)),
                read["x"].astype(np.uint16, copy=False),
                read["y"].astype(np.uint16, copy=False),
                (read["p"] > 0).view(np.uint8),
                read[LABEL] != 0 if labels else None,
            )
        except DataError:
            row = first + 1 + int(np.argmax(np.diff(read["t"].astype(np.int64)) < 0))
            raise DataError(f"times run backwards at event {row}", self.path) from None

    def _ordered(self, t_us: IntArray) -> IntArray:
        """Return times as they are to be taken: as they are."""
        return t_us

    def pieces(self, rows: int = _PIECE_ROWS, labels: bool = True) -> Iterator[EventArray]:
        """Yield all events, at most `rows` at a time, with what caused them or without."""
        for first in range(0, len(self), rows):
            yield self.rows(first, min(first + rows, len(self)), labels)

    def ms_to_idx(self) -> IntArray:
        """Return the index by millisecond (M,), as it is in the file or as it should be."""
        if self._index is not None:
            return self._index
        count = self.duration_us // US_PER_MS + 1
        if count > _MOST_MS:
            raise DataError("lasts for more than a day, which is not read", self.path)
        per_ms = np.zeros(count + 1, dtype=np.int64)
        for piece in self.pieces(labels=False):
            per_ms[1:] += np.bincount(piece.t_us // US_PER_MS, minlength=count)
        return np.cumsum(per_ms)

    def _index_at(self, ms: int) -> int:
        if self._index is None:
            return self._first_at(ms * US_PER_MS)
        return int(self._index[ms]) if ms < len(self._index) else len(self)

    def _first_at(self, t_us: int) -> int:
        """Return the number of the first event at or after a time, by halving; times must ascend."""
        low, high = 0, len(self)
        while low < high:
            middle = (low + high) // 2
            if int(self._read(self._events["t"], slice(middle, middle + 1))[0]) < t_us:
                low = middle + 1
            else:
                high = middle
        return low

    def _read_index(self) -> IntArray | None:
        if find_item(self._file, "ms_to_idx", self.path) is None:
            return None
        data = self._dataset("ms_to_idx", "ui")
        if data.shape[0] > _MOST_MS:
            raise DataError(f"ms_to_idx has {data.shape[0]} entries, but at most a day is read", self.path)
        index: IntArray = np.asarray(self._read(data, slice(None)), dtype=np.int64)
        if len(index) and (index[0] < 0 or index[-1] > len(self) or (np.diff(index) < 0).any()):
            raise DataError("ms_to_idx does not belong to these events", self.path)
        return index

    def _columns(self) -> dict[str, Any]:
        columns = {name: self._dataset(f"events/{name}", "uib") for name in _COLUMNS}
        if find_item(self._file, f"events/{LABEL}", self.path) is not None:
            columns[LABEL] = self._dataset(f"events/{LABEL}", "uib")
        lengths = {name: data.shape[0] for name, data in columns.items()}
        if len(set(lengths.values())) > 1:
            words = ", ".join(f"{name} {length}" for name, length in lengths.items())
            raise DataError(f"columns of different lengths: {words}", self.path)
        return columns

    def _dataset(self, name: str, kinds: str) -> Any:
        data = find_item(self._file, name, self.path)
        if data is None or not hasattr(data, "shape"):
            raise DataError(f"data set {name!r} is missing; an event file has events/x, y, p, t", self.path)
        if data.shape is None or data.dtype.kind not in kinds or len(data.shape) != 1:
            raise DataError(
                f"{name} must be a column of whole numbers, not {data.dtype} {data.shape}", self.path
            )
        check_storage(data, name, self.path)
        return data

    def _attribute(self, name: str, low: int, high: int) -> int | None:
        try:
            value = self._file.attrs.get(name)
        except (OSError, KeyError, RuntimeError, ValueError, TypeError):
            raise DataError(f"the attribute {name} cannot be read", self.path) from None
        return None if value is None else whole_number(f"the attribute {name}", value, low, high, self.path)

    def _read(self, data: Any, rows: slice) -> npt.NDArray[Any]:
        try:
            if rows.start is not None and rows.stop is not None:
                read = read_chunks(data, rows.start, rows.stop)
                if read is not None:
                    return read
            return np.asarray(data[rows])
        except (OSError, RuntimeError, ValueError, MemoryError) as error:
            raise reading_error(data, error, self.path) from None


def _open(path: Path) -> Any:
    import h5py

    with suppress(ImportError):  # only files with its filters need it, and those say so when they are read
        import hdf5plugin  # noqa: F401
    if not path.is_file():
        raise DataError("no such file", path)
    try:
        return h5py.File(path, "r")
    except OSError as error:
        raise opening_error(error, path) from None
