"""Arrays in a NumPy archive (`.npz`), read row by row while they are unpacked."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.errors import DataError
from jeat_graph.io.events.reader import PIECE_ROWS
from jeat_graph.io.files.limits import check_room


class NpzMember:
    """An array in a zip archive; rows are read one after the other, and from the first one again.

    Args:
        path: the archive.
        name: of the member.

    Raises:
        ValueError: it is no array of numbers.
    """

    def __init__(self, path: Path, name: str) -> None:
        self._path, self._name = path, name
        self._file: Any = None
        self._whole: npt.NDArray[Any] | None = None
        self._next = 0
        self._begin()

    def close(self) -> None:
        """Close the member; it is opened again when rows are asked for."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def rows(self, first: int, end: int) -> npt.NDArray[Any]:
        """Read rows; of an array that lies, columns.

        Raises:
            DataError: it is damaged.
        """
        try:
            if self._fortran or (len(self.shape) > 1 and self.shape[0] < self.shape[1]):
                return self._columns(first, end)
            if self._file is None or first != self._next:
                self.close()
                self._begin()
                self._skip(first)
            return self._take(end - first)
        except DataError:
            raise
        except Exception as error:  # of a damaged header, or of packed bytes
            raise DataError(
                f"{self._name} cannot be read: {' '.join(str(error).split())[:160]}", self._path
            ) from None

    def _begin(self) -> None:
        with zipfile.ZipFile(self._path) as archive:
            self._file = archive.open(self._name)
        version = np.lib.format.read_magic(self._file)
        header = (
            np.lib.format.read_array_header_1_0 if version[0] == 1 else np.lib.format.read_array_header_2_0
        )
        self.shape, self._fortran, self.dtype = header(self._file)
        if self.dtype.hasobject:
            raise ValueError(f"{self._name} holds objects of Python, no numbers")
        self._next = 0

    def _skip(self, rows: int) -> None:
        for first in range(0, rows, PIECE_ROWS):
            self._take(min(PIECE_ROWS, rows - first))

    def _take(self, count: int) -> npt.NDArray[Any]:
        width = int(np.prod(self.shape[1:], dtype=np.int64))
        need = count * width * self.dtype.itemsize
        data = self._file.read(need)
        if len(data) < need:
            raise ValueError("it is cut off")
        self._next += count
        return np.frombuffer(data, self.dtype).reshape(count, *self.shape[1:])

    def _loaded(self) -> npt.NDArray[Any]:
        """The whole array, where its bytes do not stand event by event."""
        if self._whole is None:
            check_room(float(np.prod(self.shape, dtype=np.float64)) * self.dtype.itemsize, self._path)
            self.close()
            self._begin()
            flat = np.frombuffer(self._file.read(), self.dtype)
            self._whole = flat.reshape(self.shape, order="F" if self._fortran else "C")
        return self._whole

    def _columns(self, first: int, end: int) -> npt.NDArray[Any]:
        whole = self._loaded()
        return whole[first:end] if whole.ndim < 2 or len(whole) >= whole.shape[1] else whole[:, first:end]
