"""The header of a table: which columns a CSV or Parquet file has, and whether they are the right ones."""

from __future__ import annotations

import csv
import difflib
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from jeat_graph.data.errors import DataError
from jeat_graph.data.tables.spreadsheets import is_number

_MOST_COLUMNS = 10_000
# Columns that people's tables may well have others beside them under similar names.
_NO_SLIP = ("class_id", "name", "video", "image", "box")
_LINE_END = re.compile(rb"\r\n|\n|\r")


class Header(NamedTuple):
    """The header of a CSV file.

    Attributes:
        names: of the columns.
        end: where in the file's bytes it ends.
        line: its line number, from 1.
        delimiter: what stands between fields: a comma, a tab or a semicolon.
    """

    names: list[str]
    end: int
    line: int
    delimiter: str


def split_header(data: bytes, path: Path) -> Header:
    """Read the header of a CSV file's text.

    Raises:
        DataError: it is not UTF-8, its quotes are torn, or it names more columns than any table has.
    """
    line, start = 1, 0
    while True:
        mark = _LINE_END.search(data, start)
        head = data[start : mark.start() if mark else None]
        start = mark.end() if mark else len(data)
        if head.strip():
            break
        line += 1
    try:
        text = head.decode("utf-8")
        delimiter = delimiter_of(text)
        fields = next(csv.reader([text], strict=False, delimiter=delimiter))
    except UnicodeDecodeError:
        raise DataError("is not UTF-8; save the file as UTF-8", path, line) from None
    except csv.Error as error:
        raise DataError(f"cannot be read: {error}", path, line) from None
    if len(fields) > _MOST_COLUMNS:
        raise DataError(f"has {len(fields)} columns; at most {_MOST_COLUMNS} are read", path, line)
    return Header([field.strip() for field in fields], start, line, delimiter)


def delimiter_of(header: str) -> str:
    """Tell what stands between names: the first of tab and semicolon that occurs where no comma does."""
    return "," if "," in header else next((mark for mark in "\t;" if mark in header), ",")


def check_names(
    names: Sequence[str], required: Sequence[str], optional: Sequence[str], path: Path, line: int | None
) -> None:
    """Check the names of a table's columns.

    Args:
        names: as the file has them.
        required: columns that must be there.
        optional: columns that may be there.
        path: the file, for messages.
        line: line of the header; None where there is no header that could be missing.

    Raises:
        DataError: a column is missing, misspelt or there twice, or there is no header.
    """
    if line is not None and any(is_number(name) for name in names):
        raise DataError(f"the first line must name the columns: {','.join(required)}", path, line)
    twice = next((name for name, count in Counter(names).items() if count > 1), None)
    if twice is not None:
        raise DataError(f"column {twice!r} is there twice", path, line)
    absent = [name for name in (*required, *optional) if name not in names and name not in _NO_SLIP]
    unknown = [name for name in names if name not in required and name not in optional]
    for name in required:
        if name not in names:
            near = _nearest(name, unknown, cutoff=0.5)
            hint = f"; is {near!r} meant?" if near else f"; there are {', '.join(names)[:200]}"
            raise DataError(f"column {name!r} is missing{hint}", path, line)
    for name in unknown:
        near = _nearest(name, absent, cutoff=0.75)
        if near:
            raise DataError(f"unknown column {name!r}; did you mean {near!r}?", path, line)


def _nearest(name: str, options: Sequence[str], cutoff: float) -> str | None:
    lower = {option.lower(): option for option in options}
    near = difflib.get_close_matches(name.lower(), lower, 1, cutoff)
    return lower[near[0]] if near else None
