"""Text files without a header, one box a line: what MOTChallenge and KITTI have in common."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from jeat_graph.data.arrays import IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.tables.file_table import FileTable
from jeat_graph.io.tables.csv_text import CsvBody, read_text
from jeat_graph.io.tables.file_tables import table_of

_NO_COMMA_AT_END = re.compile(rb"[^,\r\n](?:[\r\n]|\Z)")


def read_plain(
    path: str | Path, names: Mapping[int, Sequence[str]], kind: str, data: bytes | None = None
) -> FileTable:
    """Read lines of fields separated by commas or white space; a comma may stand behind every line's last.

    Args:
        path: the file; one without any line is a table without rows.
        names: the column names by number of fields; the first line's count of fields decides.
        kind: the format's name, for messages.
        data: the file's text, where it has been read.

    Raises:
        DataError: names the first line with a wrong number of fields.
    """
    file = Path(path)
    data = read_text(file, blank_ok=True) if data is None else data
    if not data.strip():
        return _without_rows(file, names[min(names)])
    data = re.sub(rb"(?m)^[ \t]+|[ \t]+(?=\r?$)", b"", data)
    data = re.sub(rb"[ \t]*,[ \t]*|[ \t]+", b",", data)
    blank_lines = len(data) - len(data.lstrip())
    first = re.split(rb"[\r\n]", data.lstrip(), maxsplit=1)[0]
    width = first.count(b",") + 1
    if width - 1 in names and first.endswith(b",") and not _NO_COMMA_AT_END.search(data):
        data, width = re.sub(rb"(?m),(?=\r?$)", b"", data), width - 1
    if width not in names:
        known = " or ".join(str(count) for count in sorted(names))
        line = 1 + len(data[:blank_lines].splitlines())
        raise DataError(f"{width} fields, but a {kind} line has {known}", path, line)
    body, columns = CsvBody(file, data, 1, width, "the first line has").parse()
    return table_of(body, names[width], columns)


def _without_rows(file: Path, names: Sequence[str]) -> FileTable:
    import pyarrow as pa

    return FileTable(file, {name: pa.chunked_array([], type=pa.string()) for name in names})


def frames_of(table: FileTable, first: int) -> IntArray:
    """Return the column `frame` (R,).

    Args:
        table: the file's table.
        first: the number of a recording's first frame in this format.

    Raises:
        DataError: names the first line whose frame number is less than `first`, or is no whole number.
    """
    frame = table.whole("frame")
    if (frame < first).any():
        row = int(np.argmax(frame < first))
        raise table.error(row, f"frames count from {first}, got {frame[row]}")
    return frame
