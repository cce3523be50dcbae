"""Folders and files that one process at a time works in; what a killed process left is known by its lock.

Locks are those of the system (`flock`; on Windows `locking`, for lock files alone): they end with the
process, however it ends, so that the lock file which a killed one leaves holds nobody up. Where a system or a
file system has none, nothing is locked and nothing is tidied up.
"""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import stat
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from jeat_graph.data.errors import DataError, InputWarning

if sys.platform == "win32":
    _HAS_LOCKS = False
else:
    import fcntl

    _HAS_LOCKS = True

#: Neither follows a link that somebody has put there, nor waits for the other end of a pipe, nor is handed on
#: to a child process, which would hold the lock beyond our end.
_OPEN_FLAGS = sum(getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_BINARY"))


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


@contextmanager
def hold_made_folder(folder: Path) -> Iterator[bool]:
    """Hold a folder as `hold_folder` does; it is made if it is missing, and goes if nothing was put into it.

    Raises:
        DataError: another process holds it, or it cannot be made.
    """
    with _made(folder), hold_folder(folder) as held:
        yield held


@contextmanager
def hold_file(path: str | Path) -> Iterator[bool]:
    """Hold a file that is to be written, so that no other process writes it at the same time.

    It may be missing, and may be replaced meanwhile: what is locked is a file of its own beside it, under a
    hidden name, which goes at the end. What a killed process left of it is taken over.

    Args:
        path: the file; what is no file (a pipe, a device) is not held.

    Yields:
        Whether it is held; where the file system has no locks it is not.

    Raises:
        DataError: another process holds it.
    """
    target = Path(os.path.realpath(path))  # one file, by whatever name
    if target.exists() and not target.is_file():
        yield False
        return
    with _made(target.parent), hold_lock_file(target.with_name(f".{target.name}.lock")) as held:
        if held is False:
            raise DataError("another command is writing it; wait for it, or give another file", path)
        yield held is True


@contextmanager
def hold_lock_file(lock: Path) -> Iterator[bool | None]:
    """Hold a file that is there for nothing else; its folder exists.

    Yields:
        True: it is held; False: another process holds it; None: it cannot be locked here.
    """
    handle = _open_lock(lock)
    if handle is None:
        yield None
        return
    held = handle >= 0
    try:
        yield held
    finally:
        if held:
            with contextlib.suppress(OSError):  # on Windows it cannot be removed while it is open
                lock.unlink()
            os.close(handle)


def _open_lock(lock: Path) -> int | None:
    """Open and lock a lock file: its handle; -1 if another process holds it, None if it cannot be locked."""
    while True:
        try:
            handle = os.open(lock, os.O_RDWR | os.O_CREAT | _OPEN_FLAGS, 0o666)
        except OSError:
            try:  # somebody else's, which may be read
                handle = os.open(lock, os.O_RDONLY | _OPEN_FLAGS)
            except OSError as error:
                if error.errno not in (errno.ENOENT, errno.ENAMETOOLONG):
                    _tell_in_the_way(lock)
                return None
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            os.close(handle)
            _tell_in_the_way(lock)
            return None
        held = _try_lock_file(handle)
        # Between its opening and its locking the process that held it may have removed it.
        if held and not _is_still(lock, handle):
            os.close(handle)
            continue
        if not held:
            os.close(handle)
        return handle if held else (None if held is None else -1)


def _is_still(path: Path, handle: int) -> bool:
    try:
        return os.path.samestat(path.stat(follow_symlinks=False), os.fstat(handle))
    except FileNotFoundError:
        return False


def _tell_in_the_way(lock: Path) -> None:
    warnings.warn(
        f"{lock} is in the way of a lock: a second command that writes the same would not be noticed",
        InputWarning,
        stacklevel=2,
    )


@contextmanager
def _made(folder: Path) -> Iterator[None]:
    """Make a folder, and those above it; in the end those go again that are empty."""
    made = []
    missing = folder
    while not missing.exists():
        made.append(missing)
        missing = missing.parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataError(f"cannot be made: {error.strerror or error}", folder) from None
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            for one in made:
                one.rmdir()


def _try_lock_file(handle: int) -> bool | None:
    """Lock an open lock file, of which nothing is read or written; as `try_lock`."""
    if sys.platform == "win32":
        import msvcrt

        try:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        except OSError as error:
            return False if error.errno in (errno.EACCES, errno.EDEADLK) else None
        return True
    return try_lock(handle)


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
