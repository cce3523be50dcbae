"""The file formats of boxes that there are, and which of them a file has.

A format is a module of this package with a record `FORMAT`; this is the only place that looks for them.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

from jeat_graph.data.errors import DataError
from jeat_graph.data.records import records_in
from jeat_graph.io.files.limits import check_file
from jeat_graph.io.files.not_tables import XML
from jeat_graph.io.formats.record import HEAD_BYTES, BoxFormat, Certainty, FileHead
from jeat_graph.io.tables.csv_text import first_bytes

_PACKAGE = "jeat_graph.io.formats"


@cache
def formats() -> tuple[BoxFormat, ...]:
    """Return the records of all formats: tables with a header first, then by name."""
    found: list[BoxFormat] = records_in(_PACKAGE, "FORMAT")
    return tuple(sorted(found, key=lambda one: (not one.is_table, one.name)))


def format_names() -> tuple[str, ...]:
    """Return the names of all formats."""
    return tuple(one.name for one in formats())


def written_formats() -> tuple[BoxFormat, ...]:
    """Return the formats that a run's tables are written in."""
    return tuple(one for one in formats() if one.suffix)


def format_named(name: str) -> BoxFormat:
    """Return a format by its name.

    Raises:
        DataError: there is none of that name.
    """
    found = {one.name: one for one in formats()}
    if name not in found:
        raise DataError(f"unknown format {name!r}; known: {', '.join(found)}")
    return found[name]


def recognise(path: str | Path, fmt: str | None = None, allowed: Sequence[str] | None = None) -> BoxFormat:
    """Return the format of a file.

    What its bytes say goes before the end of its name, that before what its first line looks like.

    Args:
        path: the file, or a folder that is one.
        fmt: the format's name, if the caller knows it; only checked.
        allowed: names of the formats that make sense here, all by default.

    Raises:
        DataError: the file is missing, or of a format that is unknown or makes no sense here.
    """
    names = format_names() if allowed is None else allowed
    if fmt is not None and fmt not in format_names():
        raise DataError(f"unknown format {fmt!r}; known: {', '.join(names)}", path)
    found = _guess(Path(path)) if fmt is None else format_named(fmt)
    if found.name not in names:
        raise DataError(f"is {found.name}; here only {', '.join(names)} can be read", path)
    return found


def counts_frames(path: str | Path, kind: BoxFormat | None = None) -> bool:
    """Tell whether a file counts frames and says no times, so that it needs a rate.

    Args:
        path: the file.
        kind: its format, if that is known.

    Raises:
        DataError: as `recognise`, where `kind` is not given.
    """
    return (recognise(path) if kind is None else kind).counts_frames(path)


def is_folder_of_boxes(path: str | Path) -> bool:
    """Tell whether a path is a folder that a format takes for one of its files."""
    return Path(path).is_dir() and any(one.is_folder(path) for one in formats() if one.is_folder is not None)


def _guess(path: Path) -> BoxFormat:
    if path.is_dir():
        for one in formats():
            if one.is_folder is not None and one.is_folder(path):
                return one
        if any(path.glob("*.xml")):
            raise DataError(XML, path)
    check_file(path)
    try:
        head = FileHead(path, first_bytes(path, HEAD_BYTES))
    except (OSError, ValueError) as error:
        raise DataError(f"cannot be read: {error}", path) from None
    sure = {one.name: one.recognise(head) for one in formats()}
    best = max(formats(), key=lambda one: sure[one.name])
    if sure[best.name] == Certainty.NONE:
        raise DataError(f"is none of the formats that are read ({', '.join(sure)})", path)
    return best
