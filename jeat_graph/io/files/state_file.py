"""A text and a block of bytes in one `.npz` file that shows whether anything in it has been changed.

The file may come from a crash, from another machine or from a stranger: what is not what was written is
refused, in one line, before anything is made of it. Nothing in it is packed, so reading takes no more memory
than its size.
"""

from __future__ import annotations

import hashlib
import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.errors import DataError
from jeat_graph.io.files.atomic import atomic_path
from jeat_graph.io.files.limits import check_file

_TEXT, _BLOCK, _DIGEST = "text", "block", "sha256"
_ENCRYPTED = 0x1  # bit of a member's flags


def write_state_file(path: str | Path, text: bytes, block: bytes) -> None:
    """Write the file; it appears when it is complete, in place of the one before."""
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        parts = {_TEXT: text, _BLOCK: block or bytes(1), _DIGEST: digest(text, block)}
        arrays: dict[str, Any] = {name: np.frombuffer(part, np.uint8) for name, part in parts.items()}
        np.savez(file, **arrays)


def digest(text: bytes, block: bytes) -> bytes:
    """Return what changes with any change to either."""
    sha = hashlib.sha256(len(text).to_bytes(8, "little") + text)
    sha.update(block or bytes(1))
    return sha.digest()


def read_state_file(path: str | Path, what: str) -> tuple[bytes, bytes]:
    """Read what `write_state_file` wrote.

    Args:
        path: the file.
        what: it should be, for messages.

    Returns:
        The text and the block.

    Raises:
        DataError: no such file, no such content, or not as it was written.
    """
    if Path(path).exists():
        check_file(path)
    try:
        with zipfile.ZipFile(path) as archive:
            text, block, written = (_member(archive, name) for name in (_TEXT, _BLOCK, _DIGEST))
    except OSError as error:
        raise DataError(f"cannot be read: {error.strerror or error}", path) from None
    except Exception as error:  # whatever garbage may raise in what unpacks it
        raise DataError(f"is no {what} ({type(error).__name__})", path) from None
    if written != digest(text, block):
        raise DataError("is damaged: it is not what was written", path)
    return text, block


def _member(archive: zipfile.ZipFile, name: str) -> bytes:
    """Return the bytes of an array of bytes, which is stored as it is."""
    info = archive.getinfo(f"{name}.npy")
    if info.compress_type != zipfile.ZIP_STORED or info.flag_bits & _ENCRYPTED:
        raise ValueError("packed or encrypted")
    content = io.BytesIO(archive.read(info))
    version = np.lib.format.read_magic(content)
    if version != (1, 0):
        raise ValueError("another version of .npy")
    shape, _, kind = np.lib.format.read_array_header_1_0(content)
    data = content.read()
    if kind != np.uint8 or shape != (len(data),):
        raise ValueError("no array of bytes")
    return data
