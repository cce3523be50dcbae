"""Files that are either whole or not there: written beside their place, then renamed.

A process that is killed leaves its unfinished file behind, under a hidden name; the next one that writes a
file of the same name takes it away. A lock tells such a leftover from a file that is just being written.
"""

from __future__ import annotations

import glob
import os
import secrets
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from jeat_graph.data.errors import DataError
from jeat_graph.io.files.locking import remove_abandoned, try_lock

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
    with naming(path):
        tempfile.TemporaryFile(dir=folder).close()


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; on success it takes its place, on error it is removed.

    The folder of `path` is made if it is missing.

    Raises:
        DataError: no file can be made there, or what is there cannot be replaced by one.
    """
    target = Path(path)
    if target.exists() and not (target.is_file() or target.is_dir()):
        # Renaming would put a file in the place of a device, /dev/null too.
        raise DataError("is a device or a pipe: give the name of a file", path)
    with naming(path):
        target.parent.mkdir(parents=True, exist_ok=True)
    prefix = f".{target.stem}.unfinished-"
    # The name is known before there is a file, so that whatever comes in between takes it away.
    temporary = target.with_name(f"{prefix}{secrets.token_hex(4)}{target.suffix}")
    handle: int | None = None
    try:
        with naming(path):
            handle = _make(temporary)
        yield temporary
        # The unfinished file is private (0600); a result file gets the permissions any other new file would.
        mask = os.umask(0)
        os.umask(mask)
        with naming(path):
            temporary.chmod(0o666 & ~mask)
            temporary.replace(target)
        if handle is not None:
            remove_abandoned(target.parent, glob.escape(prefix) + "????????" + glob.escape(target.suffix))
    finally:
        temporary.unlink(missing_ok=True)
        if handle is not None:
            os.close(handle)


@contextmanager
def naming(path: str | Path) -> Iterator[None]:
    """Let errors of the system name the file that was asked for, not the one that stands in for it.

    Raises:
        DataError: one occurred.
    """
    try:
        yield
    except OSError as error:
        raise DataError(f"cannot be written: {error.strerror or error}", path) from None


def _make(temporary: Path) -> int | None:
    """Make a new file and hold it until its handle (None: it cannot be held here) is closed."""
    while True:
        handle = os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o600)
        if temporary.suffix in _LOCKED_BY_WRITER or try_lock(handle) is None:
            os.close(handle)
            return None
        # Between its making and its locking another process may have taken it for a leftover.
        if temporary.exists() and os.path.samestat(temporary.stat(), os.fstat(handle)):
            return handle
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
