"""Smoothed rows of a live run: each is in the file as soon as it is final, and stays as it is."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Self

from jeat_graph.data.errors import DataError, InputWarning
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.files.growing import GrowingFile
from jeat_graph.io.files.pipe_writer import never
from jeat_graph.io.streams.track_lines import csv_header, csv_rows

# Headers without classes and with them, by whether identities were decided again.
_HEADS = {
    decided: tuple(csv_header(classes, decided).encode() for classes in (False, True))
    for decided in (False, True)
}


class SmoothedFile:
    """A table of the contract (CSV) that grows by whole lines; a context manager.

    Unlike the tables of a run directory it is there from the beginning: whoever reads it sees what is final
    by then, and an end of the process at any moment costs nothing that was final. Its header is written with
    the first answer of the tracker (`begin`), which shows whether there are classes. Where it is moved away,
    a new one begins with the next `flush`, which is that of a checkpoint: so a checkpoint is of one file.

    Args:
        path: the file; replaced, or with `keep_bytes` continued.
        keep_bytes: how many bytes of it to keep, from a checkpoint; what came after them comes again. If it
            has no rows now, it was moved away since: a new one begins, with a warning.
        identities: whether rows have identities that were decided again.
        over: of a pipe, tells whether the program is to end and its reader is not waited for any longer.

    Raises:
        DataError: it is a folder, or has rows, but is shorter than what is to be kept.
    """

    def __init__(
        self,
        path: str | Path,
        keep_bytes: int | None = None,
        over: Callable[[], bool] = never,
        *,
        identities: bool = False,
    ) -> None:
        self._heads = _HEADS[identities]
        self._path, self._over = Path(path), over
        if self._path.is_dir():
            raise DataError("is a folder; --smoothed must name a file", path)
        self._keep = keep_bytes or 0
        self._classes: bool | None = None
        size = self._path.stat().st_size if self._path.is_file() else 0
        if size >= self._keep:
            return
        if has_rows(self._path):
            raise DataError(f"has {size} bytes, and had {keep_bytes} when the checkpoint was written", path)
        self._keep = 0
        warnings.warn(
            f"{path}: was moved away after the checkpoint; rows since then are in both files",
            InputWarning,
            stacklevel=2,
        )

    def __enter__(self) -> Self:
        head = b""
        if self._keep:  # one without a header has nothing to be kept
            with self._path.open("rb") as file:
                head = file.readline()
        self._file = GrowingFile(self._path, self._keep, self._over)
        if head:
            self.begin(head == self._heads[True])
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
            self._file.begin(self._heads[classes])

    def append(self, table: Trajectories) -> None:
        """Add rows, and hand them to the system at once."""
        if len(table):
            self.begin(table.classes is not None)
            self._file.write(csv_rows(table, bool(self._classes)).encode())

    def flush(self) -> int:
        """Go on in a new file if this one was moved away; how many bytes the file has."""
        return self._file.follow()


def has_rows(path: str | Path) -> bool:
    """Whether a table is there that holds more than a header."""
    if not Path(path).is_file():
        return False
    with Path(path).open("rb") as file:
        heads = [head for both in _HEADS.values() for head in both]
        return file.read(max(map(len, heads)) + 1) not in (b"", *heads)
