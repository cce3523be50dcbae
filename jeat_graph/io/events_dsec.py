"""Event files in the layout of the DSEC data set: HDF5 with one array a column and an index by millisecond.

======================  =====================================================================================
`events/x`, `events/y`  (N,) uint16 column and row (px)
`events/p`              (N,) uint8 polarity, 1 brighter, 0 darker
`events/t`              (N,) uint32 time (µs), not decreasing
`ms_to_idx`             (M,) uint64: the first event at or after `ms` milliseconds, for ms = 0, 1, …
`t_offset`              int64: add to `events/t` for the time on the clock of other files (µs)
======================  =====================================================================================

Beyond DSEC, files written here have `events/by_motion` (N,) uint8 where the source knows what caused an
event, and the attributes `width`, `height` (px) and `duration_us`.
Source: https://github.com/uzh-rpg/DSEC, section "Events" of its README.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from jeat_graph.arrays import IntArray
from jeat_graph.errors import ConfigError, DataError
from jeat_graph.events import EventArray
from jeat_graph.io.atomic import atomic_path

COMPRESSIONS = ("gzip", "none", "blosc")
# Rows of one HDF5 chunk, and what the writer keeps in memory. Fixed, because the bytes depend on it.
CHUNK_ROWS = 1 << 16
_US_PER_MS = 1000
_LATEST_US = 2**32 - 1
_COLUMNS = {"x": np.uint16, "y": np.uint16, "p": np.uint8, "t": np.uint32}
_LABEL = "by_motion"


class EventWriter:
    """A context manager that writes events as they come; the file appears only when it is complete.

    The bytes are the same however the events are cut into pieces.

    Args:
        path: the file.
        size_px: width and height of the picture.
        compression: `gzip`, `none`, or `blosc`, which needs the extra `hdf5` to write and to read.

    Raises:
        ConfigError: no such compression, or `blosc` without the extra.
    """

    def __init__(self, path: str | Path, size_px: tuple[int, int], compression: str = "gzip") -> None:
        self._path = Path(path)
        self._size_px = size_px
        self._filter = compression_filter(compression)
        self._stack = ExitStack()
        self._file: Any = None
        self._pending: list[EventArray] = []
        self._pending_rows = 0
        self._labelled: bool | None = None
        self._last_us = 0
        self._per_ms: list[IntArray] = []
        self._duration_us = 0

    def __enter__(self) -> Self:
        import h5py

        temporary = self._stack.enter_context(atomic_path(self._path))
        # "earliest" keeps to the oldest structures that hold the data, which DSEC's own readers know.
        self._file = self._stack.enter_context(h5py.File(temporary, "w", libver="earliest"))
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if error is None:
                self._finish()
        except BaseException as failure:
            self._stack.__exit__(type(failure), failure, failure.__traceback__)
            raise
        self._stack.__exit__(kind, error, trace)

    def append(self, events: EventArray, until_us: int | None = None) -> None:
        """Add events that follow those before.

        Args:
            events: may be none. All or none of them have labels.
            until_us: the recording lasts at least up to here (µs); for stretches without events.

        Raises:
            DataError: they begin before the last one, lie outside the picture, come too late for 32 bits, or
                only some have labels.
        """
        if self._file is None:
            raise RuntimeError("the writer must be entered with `with` before events are appended")
        self._duration_us = max(self._duration_us, until_us or 0)
        if not len(events):
            return
        if self._labelled is None:
            self._create(labelled=events.by_motion is not None)
        self._check(events)
        self._last_us = int(events.t_us[-1])
        self._duration_us = max(self._duration_us, self._last_us + 1)
        ms = events.t_us // _US_PER_MS
        first = int(ms[0])
        counts = np.bincount(ms - first)
        held = sum(len(part) for part in self._per_ms)
        if first < held:  # the millisecond that the piece before ended in
            self._per_ms[-1][-1] += counts[0]
            counts = counts[1:]
        else:
            self._per_ms.append(np.zeros(first - held, dtype=np.int64))
        if len(counts):
            self._per_ms.append(counts.astype(np.int64))
        self._pending.append(events)
        self._pending_rows += len(events)
        if self._pending_rows >= CHUNK_ROWS:
            self._write(everything=False)

    def _check(self, events: EventArray) -> None:
        width, height = self._size_px
        if int(events.t_us[0]) < self._last_us:
            raise DataError(
                f"events begin at {events.t_us[0]} µs, before the last one at {self._last_us} µs", self._path
            )
        if int(events.t_us[-1]) > _LATEST_US:
            raise DataError(f"events later than {_LATEST_US} µs do not fit in 32 bits", self._path)
        if int(events.x.max()) >= width or int(events.y.max()) >= height:
            raise DataError(
                f"event at x = {events.x.max()}, y = {events.y.max()} outside the picture of {width} x "
                f"{height} px",
                self._path,
            )
        if self._labelled != (events.by_motion is not None):
            raise DataError("some events have labels and some have none", self._path)

    def _create(self, labelled: bool) -> None:
        self._labelled = labelled
        kinds = _COLUMNS | ({_LABEL: np.uint8} if labelled else {})
        for name, kind in kinds.items():
            self._file.create_dataset(
                f"events/{name}",
                shape=(0,),
                maxshape=(None,),
                chunks=(CHUNK_ROWS,),
                dtype=kind,
                track_times=False,
                **self._filter,
            )

    def _write(self, everything: bool) -> None:
        joined = EventArray.concatenate(self._pending)
        end = len(joined) if everything else len(joined) - len(joined) % CHUNK_ROWS
        group = self._file["events"]
        columns: dict[str, npt.NDArray[Any]] = {
            "x": joined.x,
            "y": joined.y,
            "p": joined.polarity,
            "t": joined.t_us,
        }
        if self._labelled:
            assert joined.by_motion is not None
            columns[_LABEL] = joined.by_motion
        # Chunk by chunk, so that the file's layout does not depend on how many are ready at once.
        for start in range(0, end, CHUNK_ROWS):
            rows = slice(start, min(start + CHUNK_ROWS, end))
            for name, values in columns.items():
                data = group[name]
                old = data.shape[0]
                data.resize((old + rows.stop - rows.start,))
                data[old:] = values[rows].astype(data.dtype)
        self._pending = [joined.take(slice(end, None))]
        self._pending_rows = len(joined) - end

    def _finish(self) -> None:
        if self._labelled is None:
            self._create(labelled=False)
        if self._pending:
            self._write(everything=True)
        counts = np.concatenate([np.zeros(0, dtype=np.int64), *self._per_ms])
        length = max(len(counts), -(-self._duration_us // _US_PER_MS)) + 1
        index = np.zeros(length, dtype=np.uint64)
        np.cumsum(np.pad(counts, (0, length - 1 - len(counts))), out=index[1:], dtype=np.uint64)
        self._file.create_dataset("ms_to_idx", data=index, track_times=False)
        self._file.create_dataset("t_offset", data=np.int64(0), track_times=False)
        self._file.attrs["width"], self._file.attrs["height"] = self._size_px
        self._file.attrs["duration_us"] = np.int64(self._duration_us)


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
            self._index: npt.NDArray[np.int64] = np.asarray(
                self._read(self._dataset("ms_to_idx", "ui"), slice(None)), dtype=np.int64
            )
            if len(self._index) and (self._index[-1] > len(self) or (np.diff(self._index) < 0).any()):
                raise DataError("ms_to_idx does not belong to these events", self.path)
            offset = self._file.get("t_offset")
            self.t_offset_us = 0 if offset is None else int(np.asarray(offset[()]).reshape(-1)[0])
            width, height = self._file.attrs.get("width"), self._file.attrs.get("height")
            self.size_px = None if width is None or height is None else (int(width), int(height))
            self.labelled = _LABEL in self._events
            stored = self._file.attrs.get("duration_us")
            last = int(self._read(self._events["t"], slice(len(self) - 1, None))[0]) + 1 if len(self) else 0
            self.duration_us = last if stored is None else max(int(stored), last)
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
        low = self._index_at(max(start_us, 0) // _US_PER_MS)
        high = self._index_at(-(-max(end_us, 0) // _US_PER_MS))
        if high <= low:
            return EventArray.empty(self.labelled)
        part = self.rows(low, high)
        ms = max(start_us, 0) // _US_PER_MS
        if part.t_us[0] < ms * _US_PER_MS:
            raise DataError(f"ms_to_idx is wrong at {ms} ms: that event is earlier", self.path)
        return part.between(start_us, end_us)

    def rows(self, first: int, end: int) -> EventArray:
        """Read events by number, from `first` to before `end`.

        Raises:
            DataError: times run backwards, or the data are damaged.
        """
        read = {name: self._read(data, slice(first, end)) for name, data in self._events.items()}
        for name in ("x", "y"):
            if len(read[name]) and not 0 <= int(read[name].min()) <= int(read[name].max()) < 2**16:
                raise DataError(f"events/{name}: negative or too large for 16 bits", self.path)
        labels = read[_LABEL] != 0 if self.labelled else None
        try:
            return EventArray(
                read["t"].astype(np.int64),
                read["x"].astype(np.uint16),
                read["y"].astype(np.uint16),
                (read["p"] > 0).astype(np.uint8),
                labels,
            )
        except DataError:
            row = first + 1 + int(np.argmax(np.diff(read["t"].astype(np.int64)) < 0))
            raise DataError(f"times run backwards at event {row}", self.path) from None

    def pieces(self, rows: int = 16 * CHUNK_ROWS) -> Iterator[EventArray]:
        """Yield all events, at most `rows` at a time."""
        for first in range(0, len(self), rows):
            yield self.rows(first, min(first + rows, len(self)))

    def ms_to_idx(self) -> IntArray:
        """Return the index by millisecond as it is in the file (M,)."""
        return self._index

    def _index_at(self, ms: int) -> int:
        return int(self._index[ms]) if ms < len(self._index) else len(self)

    def _columns(self) -> dict[str, Any]:
        columns = {name: self._dataset(f"events/{name}", "uib") for name in _COLUMNS}
        if f"events/{_LABEL}" in self._file:
            columns[_LABEL] = self._dataset(f"events/{_LABEL}", "uib")
        lengths = {name: data.shape[0] for name, data in columns.items()}
        if len(set(lengths.values())) > 1:
            words = ", ".join(f"{name} {length}" for name, length in lengths.items())
            raise DataError(f"columns of different lengths: {words}", self.path)
        return columns

    def _dataset(self, name: str, kinds: str) -> Any:
        data = self._file.get(name)
        if data is None or not hasattr(data, "shape"):
            raise DataError(
                f"data set {name!r} is missing; an event file has events/x, y, p, t and ms_to_idx", self.path
            )
        if data.dtype.kind not in kinds or len(data.shape) != 1:
            raise DataError(
                f"{name} must be a column of whole numbers, not {data.dtype} {tuple(data.shape)}", self.path
            )
        return data

    def _read(self, data: Any, rows: slice) -> npt.NDArray[Any]:
        try:
            return np.asarray(data[rows])
        except OSError as error:
            reason = " ".join(str(error).split())[:200]
            hint = "; pip install 'jeat-graph[hdf5]' has filters such as blosc" if "filter" in reason else ""
            raise DataError(f"cannot be read: {reason}{hint}", self.path) from None


def compression_filter(compression: str) -> dict[str, Any]:
    """Return h5py's arguments for a compression.

    Raises:
        ConfigError: no such compression, or `blosc` without the extra `hdf5`.
    """
    if compression == "none":
        return {}
    if compression == "gzip":
        return {"compression": "gzip", "compression_opts": 4, "shuffle": True}
    if compression == "blosc":
        try:
            import hdf5plugin
        except ImportError:
            raise ConfigError("compression blosc needs pip install 'jeat-graph[hdf5]'") from None
        return dict(hdf5plugin.Blosc(cname="zstd", clevel=5, shuffle=hdf5plugin.Blosc.SHUFFLE))
    raise ConfigError(f"compression must be one of {', '.join(COMPRESSIONS)}, not {compression!r}")


def _open(path: Path) -> Any:
    import h5py

    with suppress(ImportError):  # only files with its filters need it, and those say so when they are read
        import hdf5plugin  # noqa: F401
    if not path.is_file():
        raise DataError("no such file", path)
    try:
        return h5py.File(path, "r")
    except OSError as error:
        raise DataError(f"cannot be read as HDF5: {' '.join(str(error).split())[:200]}", path) from None
