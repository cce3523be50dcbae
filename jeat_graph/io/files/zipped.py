"""One file out of a zip archive, such as the text in what CVAT exports as `MOT 1.1`."""

from __future__ import annotations

import zipfile
from pathlib import Path

from jeat_graph.data.errors import DataError
from jeat_graph.io.files.unpacking import check_unpacked, most_unpacked

#: What a zip of `MOT 1.1` holds: lines of MOTChallenge text, and the names of the classes that they number.
MEMBER, LABELS = "gt/gt.txt", "gt/labels.txt"
_MAGIC = b"PK\x03\x04"
_STORED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


def is_zip(path: str | Path) -> bool:
    """Tell whether a file begins like a zip archive; false where it cannot be read."""
    try:
        if not Path(path).is_file():
            return False
        with Path(path).open("rb") as file:
            return file.read(len(_MAGIC)) == _MAGIC
    except (OSError, ValueError):
        return False


def read_member(path: str | Path, name: str) -> bytes | None:
    """Return the bytes of a file in a zip archive; None where this is no archive, or has no such file.

    Args:
        path: the archive.
        name: of the file in it, with its folder.

    Raises:
        DataError: the archive is damaged or encrypted, or the file unpacks to more than it may.
    """
    if not is_zip(path):
        return None
    try:
        with zipfile.ZipFile(path) as archive:
            if name not in archive.namelist():
                return None
            info = archive.getinfo(name)
            if info.flag_bits & 1 or info.compress_type not in _STORED:
                raise DataError(f"{name} in it is encrypted or packed in an unusual way; unpack it", path)
            # What the archive says of itself may be wrong: no more is unpacked than may be.
            check_unpacked(info.file_size, info.compress_size, path, name)
            most = most_unpacked(info.compress_size)
            with archive.open(info) as member:
                data = member.read(most + 1)
            check_unpacked(len(data), info.compress_size, path, name)
            return data
    except DataError:
        raise
    except Exception as error:  # zipfile raises nearly anything on a damaged archive
        raise DataError(f"cannot be unpacked: {' '.join(str(error).split())[:200]}", path) from None
