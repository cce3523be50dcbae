"""Smoothed rows of a live run: each is in the file as soon as it is final, and stays as it is."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO, Self

from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.streams.track_lines import csv_header, csv_rows


class SmoothedFile:
    """A table of the contract (CSV) that grows by whole lines; a context manager.

    Unlike the tables of a run directory it is there from the beginning: whoever reads it sees what is final
    by then, and an end of the process at any moment costs nothing that was final. Its header is written with
    the first answer of the tracker (`begin`), which shows whether there are classes.

    Args:
        path: the file; replaced, or with `keep_bytes` gone on with.
        keep_bytes: how many bytes of it to keep, from a checkpoint; what came after them comes again.

    Raises:
        DataError: it is a folder, or shorter than what is to be kept.
    """

    def __init__(self, path: str | Path, keep_bytes: int | None = None) -> None:
        self._path = Path(path)
        if self._path.is_dir():
            raise DataError("is a folder; --smoothed must name a file", path)
        size = self._path.stat().st_size if self._path.is_file() else 0
        if keep_bytes is not None and size < keep_bytes:
            raise DataError(f"has {size} bytes, and had {keep_bytes} when the checkpoint was written", path)
        self._keep = keep_bytes or None  # a file without a header has nothing to be kept
        self._classes: bool | None = None

    def __enter__(self) -> Self:
        if self._keep is None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._file: BinaryIO = self._path.open("wb")
        else:
            self._file = self._path.open("r+b")
            self._classes = self._file.readline() == csv_header(classes=True).encode()
            self._file.truncate(self._keep)
            self._file.seek(self._keep)
        return self

    def __exit__(self, *error: object) -> None:
        self.begin(False)
        self._file.close()

    def begin(self, classes: bool) -> None:
        """Write the header, unless it is there already.

        Args:
            classes: whether rows have classes; those of a file without such columns are left out.
        """
        if self._classes is None:
            self._classes = classes
            self._file.write(csv_header(classes).encode())
            self._file.flush()

    def append(self, table: Trajectories) -> None:
        """Add rows, and hand them to the system at once."""
        if len(table):
            self.begin(table.classes is not None)
            self._file.write(csv_rows(table, bool(self._classes)).encode())
            self._file.flush()

    def flush(self) -> int:
        """Hand all rows to the system; how many bytes the file has."""
        self._file.flush()
        return self._file.tell()
