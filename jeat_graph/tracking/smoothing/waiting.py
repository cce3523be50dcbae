"""Rows that wait to be fetched: a bounded number in memory, the rest in a temporary file."""

from __future__ import annotations

import tempfile
import warnings
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from jeat_graph.data.class_columns import unknown_classes
from jeat_graph.data.trajectories import COLUMNS, Trajectories

#: Rows beyond this many go to the file; about 20 MB.
MOST_IN_MEMORY = 100_000

_CLASS = ("classes", "class_probability")
# Rows that there is room for at first.
_ROOM = 1024


class WaitingRows:
    """Trajectory rows in the order in which they came, held until they are fetched.

    A live caller that never fetches its smoothed rows must not fill the memory with them, and one that
    fetches them at the end must get them all. So what is over the bound is put aside in an unnamed file,
    which the system frees with the process; the first time, a warning says so.

    Args:
        sensors: names of the sensors of all tables.
        most_in_memory: rows kept in memory.
    """

    def __init__(self, sensors: tuple[str, ...], most_in_memory: int = MOST_IN_MEMORY) -> None:
        self._sensors = sensors
        self._most = most_in_memory
        self._columns = _allocate(_ROOM)
        self._count = 0
        self._file: IO[bytes] | None = None
        self._blocks: list[tuple[str, ...]] = []  # the columns of each in the file

    def append(self, table: Trajectories) -> None:
        """Add the rows of a table of the same sensors."""
        start, self._count = self._count, self._count + len(table)
        if table.classes is not None and "classes" not in self._columns:
            self._columns |= dict(zip(_CLASS, unknown_classes(len(self._columns["t"])), strict=True))
        # Copied at once, while they are in the processor's cache, into arrays with room for more.
        if self._count > len(self._columns["t"]):
            old, self._columns = self._columns, _like(self._columns, 2 * self._count)
            for name, column in old.items():
                self._columns[name][:start] = column[:start]
        for name in COLUMNS:
            self._columns[name][start : self._count] = getattr(table, name)
        if "classes" in self._columns:
            self._append_classes(table, start)
        if self._count > self._most:
            self._put_aside()

    def _append_classes(self, table: Trajectories, start: int) -> None:
        classes, probability = unknown_classes(len(table))
        if table.classes is not None and table.class_probability is not None:
            classes, probability = table.classes, table.class_probability
        wider = np.promote_types(classes.dtype, self._columns["classes"].dtype)
        self._columns["classes"] = self._columns["classes"].astype(wider, copy=False)
        self._columns["classes"][start : self._count] = classes
        self._columns["class_probability"][start : self._count] = probability

    def peek(self) -> list[Trajectories]:
        """Return all rows, in order, and keep them."""
        return [*self._read_back(), *([self._in_memory()] if self._count else [])]

    def drain(self) -> list[Trajectories]:
        """Return all rows, in order, and forget them."""
        tables = self.peek()
        if self._count:
            self._columns, self._count = _allocate(len(self._columns["t"])), 0
        self._blocks = []
        if self._file is not None:
            self._file.close()
            self._file = None
        return tables

    def _in_memory(self) -> Trajectories:
        """The rows in memory, as views."""
        columns: dict[str, Any] = {name: column[: self._count] for name, column in self._columns.items()}
        return Trajectories(**columns, sensors=self._sensors)

    def _put_aside(self) -> None:
        if self._file is None:
            warnings.warn(
                "smoothed rows that nobody fetches go to a temporary file: call drain_smoothed() now and "
                "then, or set smoother.engine to none",
                stacklevel=2,
            )
            self._file = tempfile.TemporaryFile()  # noqa: SIM115 (open until the rows are fetched)
        self._file.seek(0, 2)
        for column in self._columns.values():
            np.save(self._file, column[: self._count], allow_pickle=False)
        self._blocks.append(tuple(self._columns))
        self._columns, self._count = _allocate(_ROOM), 0

    def _read_back(self) -> list[Trajectories]:
        if self._file is None:
            return []
        self._file.seek(0)
        return [
            Trajectories(
                **{name: np.load(self._file, allow_pickle=False) for name in names},
                sensors=self._sensors,
            )
            for names in self._blocks
        ]


def _allocate(rows: int) -> dict[str, NDArray[Any]]:
    """Columns of a table with room for so many rows."""
    empty = Trajectories.empty()
    return _like({name: getattr(empty, name) for name in COLUMNS}, rows)


def _like(columns: dict[str, NDArray[Any]], rows: int) -> dict[str, NDArray[Any]]:
    """The same columns with room for so many rows."""
    return {name: np.empty((rows, *one.shape[1:]), one.dtype) for name, one in columns.items()}
