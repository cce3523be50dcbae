"""Checksums of input files, so that a run says exactly what it was made from."""

from __future__ import annotations

import hashlib
from pathlib import Path

from jeat_graph.data.errors import DataError


def sha256_of(path: str | Path) -> str:
    """Return the SHA-256 of a file's bytes as 64 hexadecimal digits.

    Raises:
        DataError: the file cannot be read.
    """
    try:
        with Path(path).open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise DataError(f"cannot be read: {error.strerror or error}", path) from None
