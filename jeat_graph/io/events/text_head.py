"""What stands before the events in a file of text, and what a line of it looks like."""

from __future__ import annotations

import re
from typing import NamedTuple

from jeat_graph.io.events.layout import ROLES, role_of

#: So many bytes are looked at.
HEAD_BYTES = 1 << 16
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_COMMENTS = (b"#", b"%", b"//")
_GEOMETRY = re.compile(rb"[#%/\s]*geometry\s*[:=]?\s*(\d{1,5})\s*[,xX ]\s*(\d{1,5})\s*")
_DELIMITERS = (b",", b";", b"\t")  # else white space
_SIZE_FIELDS = 2


class TextHead(NamedTuple):
    """What stands before the events, and what their lines look like.

    Attributes:
        start: bytes before the first event.
        lines: lines before it.
        names: of the columns, if the file says them.
        size_px: width and height, if the file says them.
        delimiter: between two fields.
        words: for each column, whether its fields are words, such as `True`.
    """

    start: int
    lines: int
    names: list[str] | None
    size_px: tuple[int, int] | None
    delimiter: bytes
    words: list[bool]


def head_of(data: bytes) -> TextHead | None:
    """Look at the first bytes of a file; None if it is no text with events.

    Args:
        data: `HEAD_BYTES`, or all there are.
    """
    if b"\0" in data:
        return None
    at = len(_BYTE_ORDER_MARK) if data.startswith(_BYTE_ORDER_MARK) else 0
    names: list[str] | None = None
    size: tuple[int, int] | None = None
    lines = data[at:].splitlines(keepends=True)
    if len(data) == HEAD_BYTES and len(lines) > 1:
        lines.pop()  # cut off
    for number, line in enumerate(lines):
        plain = line.strip()
        if plain.startswith(_COMMENTS):
            size, names = _geometry(plain) or size, _names_in_comment(plain) or names
        elif plain:
            delimiter, fields = _fields(plain)
            words = [number_of(field) is None for field in fields]
            if size is None and len(fields) == _SIZE_FIELDS and all(field.isdigit() for field in fields):
                size = int(fields[0]), int(fields[1])
            elif len(fields) < len(ROLES):
                return None
            elif sum(words) <= 1:  # an event; one word may be its polarity
                named = names if names is not None and len(names) == len(fields) else None
                return TextHead(at, number, named, size, delimiter, words)
            elif names is None:
                names = _plain_names(fields)
            else:
                return None
        at += len(line)
    if names is None or len(data) == HEAD_BYTES:
        return None
    return TextHead(at, len(lines), names, size, b",", [False] * len(names))


def number_of(field: bytes) -> float | None:
    """Return the number that a field is, or None."""
    try:
        return float(field)
    except ValueError:
        return None


def _geometry(comment: bytes) -> tuple[int, int] | None:
    found = _GEOMETRY.fullmatch(comment)
    return (int(found[1]), int(found[2])) if found else None


def _names_in_comment(comment: bytes) -> list[str] | None:
    """Return the names of columns in a comment, where all four roles are among them."""
    fields = _plain_names(_fields(comment.lstrip(b"#%/ "))[1])
    roles = {found[0] for found in map(role_of, fields) if found is not None}
    return fields if roles == set(ROLES) else None


def _plain_names(fields: list[bytes]) -> list[str]:
    return [field.decode("utf-8", "replace").strip("\"' ") for field in fields]


def _fields(line: bytes) -> tuple[bytes, list[bytes]]:
    """Return what separates the fields of a line, and the fields."""
    for delimiter in _DELIMITERS:
        if delimiter in line:
            return delimiter, [field.strip() for field in line.split(delimiter)]
    return b" ", line.split()
