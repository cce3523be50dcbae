"""Recognise a file's format, by what it says of itself first, then by its name."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from jeat_graph.data.column_names import FRAME_COLUMNS, standing_in, usual_names
from jeat_graph.data.errors import DataError
from jeat_graph.data.tables.spreadsheets import is_number
from jeat_graph.io.files.limits import check_file
from jeat_graph.io.files.not_tables import XML
from jeat_graph.io.files.zipped import MEMBER, read_member
from jeat_graph.io.tables.csv_text import first_bytes, read_bytes
from jeat_graph.io.tables.headers import split_header
from jeat_graph.io.tables.yolo_labels import is_label_folder

FORMATS = ("csv", "parquet", "motchallenge", "kitti", "prophesee", "coco", "yolo")
#: Those whose tables count frames and say no times.
BY_FRAME = ("motchallenge", "kitti", "yolo")
_BOM = b"\xef\xbb\xbf"
#: Those that leave open from which number their frames count (`data.frame_numbers`).
FIRST_OPEN = ("csv", "parquet", "coco")
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
_HEADER_BYTES = 1 << 16
_TABLES = ("csv", "parquet")
_KITTI_FIELDS = 17
_MOT_FIELDS = 6


def recognise(path: str | Path, fmt: str | None = None, allowed: Sequence[str] = FORMATS) -> str:
    """Return the format of a file, one of `FORMATS`.

    The first bytes decide for Parquet and NumPy files, and for what CVAT packs as `MOT 1.1`; then the suffix;
    a file of any other name is COCO if it begins like JSON, KITTI if its first line is 17 or more words of
    which the third is no number, MOTChallenge if its first line is numbers only or there is no line, and else
    CSV. A folder of numbered text files is YOLO's.

    Args:
        path: the file.
        fmt: the format, if the caller knows it; only checked.
        allowed: the formats that make sense here.

    Raises:
        DataError: the file is missing, holds the labels of one picture, or is of a format that is unknown or
            makes no sense here.
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


def known_columns(path: str | Path, known: Sequence[str]) -> list[str]:
    """Return the columns of a table by the names that readers know; none where it has no header.

    Args:
        path: CSV or Parquet.
        known: columns that the reader asks for, see `usual_names`.
    """
    try:
        if Path(path).suffix.lower() in (".parquet", ".pq"):
            from pyarrow import parquet

            names = parquet.read_schema(path).names
        else:
            head = first_bytes(path, _HEADER_BYTES).removeprefix(_BOM)
            names = split_header(head, Path(path)).names if head.strip() else []
    except Exception:  # whoever reads the whole file says what is wrong with it
        return []
    return usual_names(names, known)


def counts_frames(path: str | Path, kind: str | None = None) -> bool:
    """Tell whether a file counts frames and says no times, so that it needs a rate.

    Args:
        path: the file.
        kind: its format, if that is known.

    Raises:
        DataError: as `recognise`, where `kind` is not given.
    """
    kind = recognise(path) if kind is None else kind
    if kind in _TABLES:
        return standing_in(known_columns(path, ("t",)), ["t"])[0] in FRAME_COLUMNS
    if kind == "coco":
        return b'"timestamp"' not in read_bytes(path)
    return kind in BY_FRAME


def _guess(path: Path) -> str:
    if path.is_dir():
        if is_label_folder(path):
            return "yolo"
        if any(path.glob("*.xml")):
            raise DataError(XML, path)
    check_file(path)
    try:
        head = first_bytes(path, _HEAD_BYTES)
    except (OSError, ValueError) as error:
        raise DataError(f"cannot be read: {error}", path) from None
    for magic, name in _MAGIC.items():
        if head.startswith(magic):
            return name
    if read_member(path, MEMBER) is not None:
        return "motchallenge"
    suffix = Path(path.stem).suffix.lower() if path.suffix.lower() == ".gz" else path.suffix.lower()
    if suffix in _SUFFIX:
        return _SUFFIX[suffix]
    text = head.removeprefix(_BOM).lstrip().decode("utf-8", errors="replace")
    if text[:1] in ("[", "{"):
        return "coco"
    if not text and len(head) < _HEAD_BYTES:
        return "motchallenge"
    line = re.split(r"[\r\n]", text, maxsplit=1)[0]
    words = line.split()
    if len(words) >= _KITTI_FIELDS and "," not in line and not is_number(words[2]):
        return "kitti"
    fields = re.split(r"\s*,\s*|\s+", re.sub(r",\s*$", "", line).strip())
    if _is_label_of_yolo(fields):
        raise DataError(
            "looks like labels of YOLO (class, centre and size in shares of the picture, one file for each): "
            "give the folder with the files of all pictures, with --image WIDTHxHEIGHT and --rate",
            path,
            1,
        )
    return "motchallenge" if len(fields) >= _MOT_FIELDS and all(map(is_number, fields)) else "csv"
