"""What a reader refuses before it begins: files without an end, and more than the memory can hold."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from jeat_graph.data.errors import DataError

_GIB = 2.0**30
#: Where Linux tells a container how much it may use, and how much it uses (bytes).
_CGROUP = Path("/sys/fs/cgroup")
_MEMINFO = Path("/proc/meminfo")


def check_file(path: str | Path) -> None:
    """Refuse what is no file, or one that the free memory cannot hold.

    Devices (`/dev/zero`) have no end, and a pipe can be read once, but a file is looked at several times: to
    recognise it, to read it, to take its checksum.

    Raises:
        DataError: no such file, a folder, a device or pipe, or too large.
    """
    try:
        found = os.stat(path)
    except FileNotFoundError:
        raise DataError("no such file", path) from None
    except (OSError, ValueError) as error:
        raise DataError(f"cannot be read: {getattr(error, 'strerror', None) or error}", path) from None
    if stat.S_ISDIR(found.st_mode):
        raise DataError("is a folder; give a file", path)
    if not stat.S_ISREG(found.st_mode):
        raise DataError("is a pipe or a device; save its content as a file first", path)
    check_room(found.st_size, path)


def check_room(need: float, path: str | Path) -> None:
    """Refuse what would not fit into memory, where the system tells how much is free.

    Args:
        need: how much it takes at least (bytes).
        path: the file, for the message.

    Raises:
        DataError: says how much is needed and how much there is.
    """
    free = free_memory()
    if free is not None and need > free:
        raise DataError(
            f"needs at least {need / _GIB:.3g} GiB of memory, and {free / _GIB:.3g} GiB are free", path
        )


def free_memory() -> float | None:
    """Memory that can be had without swapping (bytes), a container's limit included; None if unknown."""
    bounds = []
    try:
        lines = _MEMINFO.read_text(encoding="ascii").splitlines()
        bounds += [1024.0 * float(line.split()[1]) for line in lines if line.startswith("MemAvailable:")]
        limit = (_CGROUP / "memory.max").read_text(encoding="ascii").strip()
        used = (_CGROUP / "memory.current").read_text(encoding="ascii").strip()
        if limit != "max":
            # Pages of files count as used, but give way.
            pages = (_CGROUP / "memory.stat").read_text(encoding="ascii").splitlines()
            cached = sum(float(line.split()[1]) for line in pages if line.startswith("file "))
            bounds.append(float(limit) - float(used) + cached)
    except (OSError, ValueError, IndexError):
        pass
    return min(bounds, default=None)
