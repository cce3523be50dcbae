"""Folders and files that one process at a time works in; what a killed process left is known by its lock.

Locks are those of the system (`flock`): they end with the process, however it ends. Where a system or a file
system has none, nothing is locked and nothing is tidied up.
"""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from jeat_graph.data.errors import DataError

try:
    import fcntl
except ImportError:  # Windows
    _HAS_LOCKS = False
else:
    _HAS_LOCKS = True


@contextmanager
def hold_folder(folder: Path) -> Iterator[bool]:
    """Hold a folder, which exists, so that no other process writes its results there at the same time.

    Yields:
        Whether it is held; where the file system has no locks it is not.

    Raises:
        DataError: another process holds it.
    """
    handle = os.open(folder, os.O_RDONLY) if _HAS_LOCKS else None
    try:
        if handle is None:
            yield False
            return
        held = try_lock(handle)
        if held is False:
            raise DataError("another command is writing here; wait for it, or give another folder", folder)
        yield held is True
    finally:
        if handle is not None:
            os.close(handle)


def try_lock(handle: int) -> bool | None:
    """Lock an open file; False if another process holds it, None if it cannot be locked here."""
    if not _HAS_LOCKS:
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


def remove_abandoned(folder: Path, pattern: str) -> None:
    """Remove files of a pattern that no process holds (see `try_lock`); errors are passed over."""
    for path in folder.glob(pattern):
        with contextlib.suppress(OSError):
            handle = os.open(path, os.O_RDONLY)
            try:
                if try_lock(handle):
                    path.unlink()
            finally:
                os.close(handle)


def remove_folders(folder: Path, pattern: str) -> None:
    """Remove folders of a pattern, for whoever holds the one they stand in; errors are passed over."""
    for path in folder.glob(pattern):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
