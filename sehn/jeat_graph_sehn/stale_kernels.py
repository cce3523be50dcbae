"""Throws away compiled code that an update has made out of date, before any of it is loaded.

The compiler notices that a kernel's own file has changed, but not that a file has whose functions, types or
constants went into the kernel: after an update it would go on with old machine code, or stumble over types
that are no more. So the sizes and times of all sources are kept beside the compiled code; where one differs,
the code of that file and of every file that imports it, directly or through others, is compiled again.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
from collections.abc import Mapping
from pathlib import Path

_RECORD = "kernels.json"
_COMPILED = (".nbi", ".nbc", ".spent")
_IMPORT = re.compile(
    r"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+import[ \t]*(\([^)]*\)|[^\n]*)|import[ \t]+([\w.]+))", re.M
)

Stamps = dict[str, list[int]]


def drop_stale(folders: Mapping[str, Path], cache: Path | None = None) -> int:
    """Remove compiled code that no longer fits the sources, and note down what the rest fits.

    Args:
        folders: where the package lies, the package itself first: the dotted name of a package and its
            folder; folders within are found.
        cache: folder that holds compiled code of everybody; None where it lies in `__pycache__` beside
            the sources.

    Returns:
        The number of modules whose code was thrown away. What cannot be removed or written stays.
    """
    sources: dict[str, str] = {}
    now: Stamps = {}
    for package, folder in folders.items():
        _find(str(folder), package, sources, now)
    record = _place(str(next(iter(folders.values()))), cache) / _RECORD
    before = _read(record)
    if now == before:
        return 0
    changed = {name for name in now.keys() | before.keys() if now.get(name) != before.get(name)}
    count = 0
    for name in _importers(sources, changed):
        if name in sources:
            count += _remove(sources[name], cache)
    _write(record, now)
    return count


def _find(folder: str, package: str, sources: dict[str, str], stamps: Stamps) -> None:
    """Add every module within a folder by its dotted name: its file, and that file's size and time."""
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.endswith(".py"):
                name = package if entry.name == "__init__.py" else f"{package}.{entry.name[:-3]}"
                found = entry.stat()
                sources[name], stamps[name] = entry.path, [found.st_size, found.st_mtime_ns]
            elif entry.name[0] not in "_." and entry.is_dir():
                _find(entry.path, f"{package}.{entry.name}", sources, stamps)


def _importers(sources: Mapping[str, str], changed: set[str]) -> set[str]:
    """Return the changed modules and all that import one of them, directly or through others."""
    imported_by: dict[str, set[str]] = {}
    for name, path in sources.items():
        for origin, names, whole in _IMPORT.findall(Path(path).read_text(encoding="utf-8")):
            members = [f"{origin}.{word}" for word in re.findall(r"\w+", names)] if origin else []
            for module in (origin or whole, *members):
                imported_by.setdefault(module, set()).add(name)
    reached: set[str] = set()
    waiting = set(changed)
    while waiting:
        name = waiting.pop()
        reached.add(name)
        waiting |= imported_by.get(name, set()) - reached
    return reached


def _place(folder: str, cache: Path | None) -> Path:
    """Return where the compiler keeps the code of a folder's files, within a cache as it names it there."""
    full = os.path.abspath(folder)
    if cache is None:
        return Path(full) / "__pycache__"
    return cache / f"{Path(full).name}_{hashlib.sha1(full.encode()).hexdigest()}"


def _remove(source: str, cache: Path | None) -> int:
    folder, name = os.path.split(source)
    removed = False
    with contextlib.suppress(OSError):
        for path in _place(folder, cache).glob(f"{name[:-3]}.*"):
            if path.suffix in _COMPILED:
                path.unlink(missing_ok=True)
                removed = True
    return int(removed)


def _read(record: Path) -> Stamps:
    try:
        found = json.loads(record.read_bytes())
    except (OSError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _write(record: Path, stamps: Stamps) -> None:
    beside = record.with_name(f"{record.name}.{os.getpid()}")
    with contextlib.suppress(OSError):
        record.parent.mkdir(parents=True, exist_ok=True)
        beside.write_text(json.dumps(stamps), encoding="utf-8")
        beside.replace(record)
