"""Checksums of input files, so that a run says exactly what it was made from."""

from __future__ import annotations

import hashlib
from pathlib import Path

from jeat_graph.data.errors import DataError


def size_of(path: str | Path) -> int:
    """Return the size of a file, or of all files of a folder (bytes)."""
    return sum(file.stat().st_size for file in _files(Path(path)))


def _files(path: Path) -> list[Path]:
    """The file itself, or those of a folder in the order of their names; not those of its folders."""
    return [path] if not path.is_dir() else sorted(file for file in path.iterdir() if file.is_file())


def sha256_of(path: str | Path) -> str:
    """Return the SHA-256 of a file's bytes, or of a folder's names and files, as 64 hexadecimal digits.

    Raises:
        DataError: the file cannot be read.
    """
    if Path(path).is_dir():
        parts = [f"{sha256_of(file)} {file.name}\n" for file in _files(Path(path))]
        return hashlib.sha256("".join(parts).encode("utf-8", "surrogateescape")).hexdigest()
    try:
        with Path(path).open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise DataError(f"cannot be read: {error.strerror or error}", path) from None
