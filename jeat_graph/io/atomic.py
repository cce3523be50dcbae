"""Files that are either whole or not there: written beside their place, then renamed.

A process that is killed leaves its unfinished file behind, under a hidden name; the next one that writes a
file of the same name takes it away. A lock tells such a leftover from a file that is just being written.
"""

from __future__ import annotations

import glob
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from jeat_graph.data.errors import DataError
from jeat_graph.io.locking import remove_abandoned, try_lock

#: HDF5's library locks its files itself, and would fail for our lock.
_LOCKED_BY_WRITER = (".h5", ".hdf5")


def check_writable(path: str | Path) -> None:
    """Check, before long work, that a file can be written at `path`; nothing is made there.

    Raises:
        DataError: its folder, or the nearest one above it that exists, takes no files.
    """
    folder = Path(path).parent
    while not folder.exists():
        folder = folder.parent
    try:
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        raise DataError(f"cannot be written: {error.strerror or error}", path) from None


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; on success it takes its place, on error it is removed.

    The folder of `path` is made if it is missing.
    """
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    prefix = f".{target.stem}.unfinished-"
    handle, temporary = _make(target.parent, prefix, target.suffix)
    try:
        yield temporary
        # mkstemp files are private (0600); a result file gets the permissions any other new file would.
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        temporary.replace(target)
        if handle is not None:
            remove_abandoned(target.parent, glob.escape(prefix) + "????????" + glob.escape(target.suffix))
    finally:
        temporary.unlink(missing_ok=True)
        if handle is not None:
            os.close(handle)


def _make(folder: Path, prefix: str, suffix: str) -> tuple[int | None, Path]:
    """Make a new file and hold it until its handle (None: it cannot be held here) is closed."""
    while True:
        handle, name = tempfile.mkstemp(dir=folder, prefix=prefix, suffix=suffix)
        if suffix in _LOCKED_BY_WRITER or try_lock(handle) is None:
            os.close(handle)
            return None, Path(name)
        # Between its making and its locking another process may have taken it for a leftover.
        if os.path.exists(name) and os.path.samestat(os.stat(name), os.fstat(handle)):
            return handle, Path(name)
        os.close(handle)


@contextmanager
def open_atomic(path: str | Path) -> Iterator[TextIO]:
    r"""Open a UTF-8 text file for writing that appears at `path` only when it is complete.

    Bytes of a file's name that are not UTF-8 are written as `\udcXX`, which is what JSON and YAML call them.
    """
    with (
        atomic_path(path) as temporary,
        temporary.open("w", encoding="utf-8", errors="backslashreplace", newline="\n") as file,
    ):
        yield file
