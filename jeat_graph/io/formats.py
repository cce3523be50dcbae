"""Recognise a file's format, by what it says of itself first, then by its name."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from jeat_graph.data.errors import DataError
from jeat_graph.io.csv_text import first_bytes
from jeat_graph.io.headers import is_number
from jeat_graph.io.limits import check_file

FORMATS = ("csv", "parquet", "motchallenge", "kitti", "prophesee", "coco")
#: Those whose tables count frames and say no times.
BY_FRAME = ("motchallenge", "kitti")
_MAGIC = {b"PAR1": "parquet", b"\x93NUMPY": "prophesee"}
_SUFFIX = {
    ".csv": "csv",
    ".tsv": "csv",
    ".parquet": "parquet",
    ".pq": "parquet",
    ".npy": "prophesee",
    ".json": "coco",
}
_HEAD_BYTES = 4096
_KITTI_FIELDS = 17
_MOT_FIELDS = 6


def recognise(path: str | Path, fmt: str | None = None, allowed: Sequence[str] = FORMATS) -> str:
    """Return the format of a file, one of `FORMATS`.

    The first bytes decide for Parquet and NumPy files; then the suffix; a file of any other name is COCO if
    it begins like JSON, KITTI if its first line is 17 or more words of which the third is no number,
    MOTChallenge if its first line is numbers only, and else CSV.

    Args:
        path: the file.
        fmt: the format, if the caller knows it; only checked.
        allowed: the formats that make sense here.

    Raises:
        DataError: the file is missing, holds labels of YOLO, or is of a format that is unknown or makes no
            sense here.
    """
    if fmt is None:
        fmt = _guess(Path(path))
    if fmt not in FORMATS:
        raise DataError(f"unknown format {fmt!r}; known: {', '.join(allowed)}", path)
    if fmt not in allowed:
        raise DataError(f"is {fmt}; here only {', '.join(allowed)} can be read", path)
    return fmt


def _is_label_of_yolo(fields: Sequence[str]) -> bool:
    """Whether the words of a line are a class, four shares of a picture and perhaps a score and a track."""
    if len(fields) not in (5, 6, 7) or not all(map(is_number, fields)):
        return False
    x, y, width, height = map(float, fields[1:5])
    return (
        fields[0].isdigit()
        and min(width, height) > 0.0
        and max(x, y, width, height) <= 1.0
        and min(x, y) >= 0.0
    )


def _guess(path: Path) -> str:
    check_file(path)
    try:
        head = first_bytes(path, _HEAD_BYTES)
    except (OSError, ValueError) as error:
        raise DataError(f"cannot be read: {error}", path) from None
    for magic, name in _MAGIC.items():
        if head.startswith(magic):
            return name
    suffix = Path(path.stem).suffix.lower() if path.suffix.lower() == ".gz" else path.suffix.lower()
    if suffix in _SUFFIX:
        return _SUFFIX[suffix]
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip().decode("utf-8", errors="replace")
    if text[:1] in ("[", "{"):
        return "coco"
    line = re.split(r"[\r\n]", text, maxsplit=1)[0]
    words = line.split()
    if len(words) >= _KITTI_FIELDS and "," not in line and not is_number(words[2]):
        return "kitti"
    fields = re.split(r"\s*,\s*|\s+", line.strip())
    if _is_label_of_yolo(fields):
        raise DataError(
            "looks like labels of YOLO (class, centre and size in shares of the picture, one file for each): "
            "write all pictures into one table with t, sensor, left, top, width, height in px, and score",
            path,
            1,
        )
    return "motchallenge" if len(fields) >= _MOT_FIELDS and all(map(is_number, fields)) else "csv"
