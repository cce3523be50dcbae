"""Prophesee's HDF5 files: one table of events, compressed by a codec of their own unless it was left out.

======================  =====================================================================================
`CD/events`             (N,) records of `x`, `y` (px), `p` (1 brighter, 0 darker), `t` (µs)
`EXT_TRIGGER/events`    (M,) records of `p` (1 rising), `t` (µs), `id` (channel)
attribute `geometry`    such as `1280x720`
======================  =====================================================================================

The codec (ECF, HDF5 filter 36559) comes with Prophesee's software as a plugin of HDF5; where it is installed
and `HDF5_PLUGIN_PATH` names its folder, these files are read, and elsewhere the error says what is missing.
Source: https://docs.prophesee.ai/stable/data/file_formats/hdf5.html
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.io.events.ascending import Ascending
from jeat_graph.io.events.hdf5_items import check_storage, find_item, missing_filters, reading_error
from jeat_graph.io.events.reader import PIECE_ROWS, EventReader, Triggers, agreed_size

TABLE, EDGES = "CD/events", "EXT_TRIGGER/events"
_ECF_FILTER = 36559
_NO_LIMIT = 1 << 16


class PropheseeHdf5Reader(EventReader):
    """Reads Prophesee's HDF5.

    Args:
        path: the file.
        file: the open `h5py.File`, closed with the reader.
        size_px: width and height of the picture; by default as the file says.

    Raises:
        DataError: a table that is not there or of another kind.
    """

    format_name = "HDF5 (Prophesee)"

    def __init__(self, path: Path, file: Any, size_px: tuple[int, int] | None) -> None:
        super().__init__(path, agreed_size(size_px, _geometry(file), path))
        self._file = file
        self._table = self._open(TABLE, ("x", "y", "p", "t"))
        self._edges = None if find_item(file, EDGES, path) is None else self._open(EDGES, ("p", "t", "id"))

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def pieces(self) -> Iterator[EventArray]:
        """Yield all events in the order of their times, at most `PIECE_ROWS` at a time.

        Raises:
            DataError: the codec is not installed, or the data are damaged.
        """
        self.triggers = self._triggers()
        width, height = self.size_px or (_NO_LIMIT, _NO_LIMIT)
        ascending = Ascending(self.damage)
        for first in range(0, self._table.shape[0], PIECE_ROWS):
            rows = self._read(self._table, slice(first, first + PIECE_ROWS))
            x, y = rows["x"].astype(np.int64), rows["y"].astype(np.int64)
            inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
            t = ascending(rows["t"].astype(np.int64)[inside])
            self.damage.outside += int((~inside).sum())
            self.damage.events += len(t)
            yield EventArray(
                t,
                x[inside].astype(np.uint16),
                y[inside].astype(np.uint16),
                (rows["p"][inside] > 0).astype(np.uint8),
            )
            self.triggers = Triggers.none()

    def _triggers(self) -> Triggers:
        if self._edges is None:
            return Triggers.none()
        rows = self._read(self._edges, slice(None))
        return Triggers(
            rows["t"].astype(np.int64), rows["id"].astype(np.uint8), (rows["p"] > 0).astype(np.uint8)
        )

    def _open(self, name: str, fields: tuple[str, ...]) -> Any:
        data = find_item(self._file, name, self.path)
        names = getattr(getattr(data, "dtype", None), "names", None) or ()
        if not set(fields) <= set(names) or len(data.shape) != 1:
            raise DataError(f"{name} must be a table of records with {', '.join(fields)}", self.path)
        if any(data.dtype[field].kind not in "uib" for field in fields):
            raise DataError(f"{name}: {', '.join(fields)} must be whole numbers", self.path)
        check_storage(data, name, self.path)
        return data

    def _read(self, data: Any, rows: slice) -> npt.NDArray[Any]:
        if _ECF_FILTER in missing_filters(data):
            raise DataError(
                "is compressed by Prophesee's codec ECF (HDF5 filter 36559), which is not installed: install "
                "its plugin and name its folder in HDF5_PLUGIN_PATH, or export the recording as RAW",
                self.path,
            )
        try:
            return np.asarray(data[rows])
        except (OSError, RuntimeError, ValueError, MemoryError) as error:
            raise reading_error(data, error, self.path) from None


def _geometry(file: Any) -> tuple[int, int] | None:
    try:
        value = file.attrs.get("geometry", "")
    except (OSError, KeyError, RuntimeError, ValueError, TypeError):
        return None
    text = value.decode("latin-1") if isinstance(value, bytes) else str(value)
    found = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text.strip())
    return (int(found[1]), int(found[2])) if found and int(found[1]) and int(found[2]) else None
