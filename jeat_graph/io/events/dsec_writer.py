"""Write event files in the layout of the DSEC data set (see `events_dsec`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import IntArray
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.data.events import EventArray
from jeat_graph.data.extras import install
from jeat_graph.io.events.dsec_hdf5 import LABEL, US_PER_MS
from jeat_graph.io.files.atomic import atomic_path
from jeat_graph.io.files.piecewise import PiecewiseWriter

COMPRESSIONS = ("gzip", "none", "blosc")
# Rows of one HDF5 chunk, and what the writer keeps in memory. Fixed, because the bytes depend on it.
CHUNK_ROWS = 1 << 16
_LATEST_US = 2**32 - 1
_COLUMNS = {"x": np.uint16, "y": np.uint16, "p": np.uint8, "t": np.uint32}


class EventWriter(PiecewiseWriter):
    """A context manager that writes events as they come; the file appears only when it is complete.

    The bytes are the same however the events are cut into pieces.

    Args:
        path: the file.
        size_px: width and height of the picture.
        compression: `gzip`, `none`, or `blosc`, which needs the extra `hdf5` to write and to read.
        t_offset_us: what leads from the events' times to the clock of other files (µs).

    Raises:
        ConfigError: no such compression, or `blosc` without the extra.
    """

    def __init__(
        self, path: str | Path, size_px: tuple[int, int], compression: str = "gzip", t_offset_us: int = 0
    ) -> None:
        super().__init__()
        self._path = Path(path)
        self._size_px = size_px
        self._filter = compression_filter(compression)
        self._t_offset_us = t_offset_us
        self._file: Any = None
        self._pending: list[EventArray] = []
        self._pending_rows = 0
        self._labelled: bool | None = None
        self._last_us = 0
        self._per_ms: list[IntArray] = []
        self._duration_us = 0

    def _begin(self) -> None:
        import h5py

        temporary = self._stack.enter_context(atomic_path(self._path))
        # "earliest" keeps to the oldest structures that hold the data, which DSEC's own readers know.
        self._file = self._stack.enter_context(h5py.File(temporary, "w", libver="earliest"))

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
        ms = events.t_us // US_PER_MS
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
        kinds = _COLUMNS | ({LABEL: np.uint8} if labelled else {})
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
            columns[LABEL] = joined.by_motion
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
        length = max(len(counts), -(-self._duration_us // US_PER_MS)) + 1
        index = np.zeros(length, dtype=np.uint64)
        np.cumsum(np.pad(counts, (0, length - 1 - len(counts))), out=index[1:], dtype=np.uint64)
        self._file.create_dataset("ms_to_idx", data=index, track_times=False)
        self._file.create_dataset("t_offset", data=np.int64(self._t_offset_us), track_times=False)
        self._file.attrs["width"], self._file.attrs["height"] = self._size_px
        # RVT's preprocessing looks for the size here, and takes 1280 x 720 for granted where it is not.
        for name, size in zip(("width", "height"), self._size_px, strict=True):
            self._file.create_dataset(f"events/{name}", data=np.uint16(size), track_times=False)
        self._file.attrs["duration_us"] = np.int64(self._duration_us)


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
            raise ConfigError(f"compression blosc needs {install('hdf5')}") from None
        return dict(hdf5plugin.Blosc(cname="zstd", clevel=5, shuffle=hdf5plugin.Blosc.SHUFFLE))
    raise ConfigError(f"compression must be one of {', '.join(COMPRESSIONS)}, not {compression!r}")
