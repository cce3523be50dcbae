"""Files that grow by whole lines for months, and may be moved away meanwhile (logrotate); or pipes.

A file that was moved away keeps what it has; the next lines begin a new file under the old name. One that was
emptied in its place (`copytruncate`) starts over, too. Both begin with the same head.
"""

from __future__ import annotations

import contextlib
import os
import stat
from collections.abc import Callable
from io import FileIO
from pathlib import Path

from jeat_graph.io.files.pipe_writer import PipeWriter, is_pipe, never


class GrowingFile:
    """Writes lines to the end of a file; each is handed to the system at once.

    Args:
        path: the file; its folder is made if it is missing.
        keep_bytes: how much of it to keep; the rest is cut off.
        over: of a pipe, tells whether the program is to end and its reader is not waited for any longer.
    """

    def __init__(self, path: str | Path, keep_bytes: int = 0, over: Callable[[], bool] = never) -> None:
        self._path = Path(path)
        self._head = b""
        self._path.parent.mkdir(parents=True, exist_ok=True)
        # A pipe or a device is what it is: it can neither be cut nor be emptied.
        self._pipe = PipeWriter(path, over) if is_pipe(path) else None
        self._is_file = False
        self._size = keep_bytes
        if self._pipe is None:
            self._file = self._opened()
            self._is_file = stat.S_ISREG(os.fstat(self._file.fileno()).st_mode)
        if self._is_file:
            self._file.truncate(keep_bytes)

    def begin(self, head: bytes) -> None:
        """Say how each file begins, and write that if this one is empty."""
        self._head = head
        if not self._size:
            self._write(head)

    def write(self, lines: bytes) -> None:
        """Add lines."""
        if self._is_file and os.fstat(self._file.fileno()).st_size < self._size:  # somebody emptied it
            self._size = 0
            self._write(self._head)
        self._write(lines)

    def follow(self) -> int:
        """Go on in a new file if this one was moved away; how many bytes the file has (B)."""
        if self._is_file and self._is_moved():
            self._file.close()
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._file = self._opened()
            self._size = os.fstat(self._file.fileno()).st_size
            if not self._size:
                self._write(self._head)
        return self._size

    def close(self) -> None:
        """Close the file."""
        (self._pipe or self._file).close()

    def _is_moved(self) -> bool:
        try:
            return not os.path.samestat(self._path.stat(), os.fstat(self._file.fileno()))
        except FileNotFoundError:
            return True

    def _opened(self) -> FileIO:
        # To the end, wherever that is by now: into a file that was emptied no hole is written.
        return self._path.open("ab", buffering=0)

    def _write(self, data: bytes) -> None:
        if self._pipe is not None:
            self._pipe.write(data)
        else:
            self._write_whole(data)
        self._size += len(data)

    def _write_whole(self, data: bytes) -> None:
        """Write all or nothing: of lines that the disk has no room for, none is left half written."""
        done = 0
        try:
            while done < len(data):
                done += self._file.write(data[done:])
        except OSError as error:
            if self._is_file:
                with contextlib.suppress(OSError):
                    self._file.truncate(os.fstat(self._file.fileno()).st_size - done)
            error.filename = str(self._path)
            raise
