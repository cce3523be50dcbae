"""Rows that wait to be fetched: a bounded number in memory, the rest in a temporary file."""

from __future__ import annotations

import tempfile
import warnings
from dataclasses import fields
from typing import IO

import numpy as np

from jeat_graph.data.trajectories import Trajectories

#: Rows beyond this many go to the file; about 20 MB.
MOST_IN_MEMORY = 100_000


class WaitingRows:
    """Trajectory rows in the order in which they came, held until they are taken.

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
        self._parts: list[Trajectories] = []
        self._count = 0
        self._file: IO[bytes] | None = None
        self._blocks = 0

    def append(self, table: Trajectories) -> None:
        """Add the rows of a table of the same sensors."""
        if not len(table):
            return
        self._parts.append(table)
        self._count += len(table)
        if self._count > self._most:
            self._put_aside()

    def peek(self) -> list[Trajectories]:
        """Return all tables, in order, and keep them."""
        return [*self._read_back(), *self._parts]

    def take(self) -> list[Trajectories]:
        """Return all tables, in order, and forget them."""
        tables = self.peek()
        self._parts, self._count, self._blocks = [], 0, 0
        if self._file is not None:
            self._file.close()
            self._file = None
        return tables

    def _put_aside(self) -> None:
        if self._file is None:
            warnings.warn(
                "smoothed rows that nobody fetches go to a temporary file: call drain_smoothed() now and "
                "then, or set smoother.engine to none",
                stacklevel=2,
            )
            self._file = tempfile.TemporaryFile()  # noqa: SIM115 (open until the rows are taken)
        self._file.seek(0, 2)
        block = Trajectories.concatenate(self._parts)
        for name in _COLUMNS:
            np.save(self._file, getattr(block, name), allow_pickle=False)
        self._blocks += 1
        self._parts, self._count = [], 0

    def _read_back(self) -> list[Trajectories]:
        if self._file is None:
            return []
        self._file.seek(0)
        return [
            Trajectories(
                **{name: np.load(self._file, allow_pickle=False) for name in _COLUMNS}, sensors=self._sensors
            )
            for _ in range(self._blocks)
        ]


_COLUMNS = tuple(f.name for f in fields(Trajectories) if f.name != "sensors")
