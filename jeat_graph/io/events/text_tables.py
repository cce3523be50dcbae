"""Events as lines of text: RPG's `events.txt`, CSV of Metavision, DV and others; plain, in zip or in gzip.

A line is one event, its four fields separated by white space, commas or semicolons. Before them may stand
comments (`#`, `%`; `%geometry:640,480` gives the picture's size), a line with width and height alone, and a
line with the names of the columns.
Sources: https://rpg.ifi.uzh.ch/davis_data.html, https://github.com/uzh-rpg/rpg_e2vid (the line "W H"),
https://docs.prophesee.ai (CSV of `metavision_file_to_csv`)
"""

from __future__ import annotations

import gzip
import re
import zipfile
import zlib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from jeat_graph.data.errors import DataError
from jeat_graph.io.events.layout import EventLayout, polarity_of_words
from jeat_graph.io.events.reader import Damage
from jeat_graph.io.events.tables import Block, EventTable
from jeat_graph.io.events.text_head import HEAD_BYTES, TextHead, head_of, number_of

#: Read at a time; a column of a block takes about as much.
BLOCK_BYTES = 1 << 23
_DAMAGED = (OSError, EOFError, zlib.error, zipfile.BadZipFile, NotImplementedError, RuntimeError)

_Open = Callable[[], BinaryIO]


def text_table(path: Path, layout: EventLayout, start: bytes) -> EventTable | None:
    """Return the table of a file of text, or None if it is no text with events.

    Args:
        path: the file.
        layout: names the member of a zip archive.
        start: the first bytes of the file.

    Raises:
        DataError: an archive that is damaged, holds no events, or several files with some.
    """
    kind: str = "text"
    begin: _Open = partial(_open_plain, path)
    if start.startswith(b"PK\x03\x04"):
        member = _member(path, layout)
        if member is None:
            return None
        kind, begin = f"text in a zip archive, {member}", partial(_open_member, path, member)
    elif layout.stream is not None:
        raise DataError(f"is one text, of which --event-stream {layout.stream} names no part", path)
    elif start.startswith(b"\x1f\x8b"):
        kind, begin = "text in gzip", partial(_open_gzip, path)
    try:
        with begin() as file:
            head = head_of(file.read(HEAD_BYTES))
    except _DAMAGED as error:
        if kind == "text in gzip":
            return None  # whoever asked says that it is gzip
        raise DataError(f"cannot be unpacked: {error}", path) from None
    if head is None:
        return None
    damage = Damage()
    return EventTable(
        kind=kind,
        names=head.names,
        blocks=lambda: _blocks(path, begin, head, damage),
        size_px=head.size_px,
        damage=damage,
    )


def _member(path: Path, layout: EventLayout) -> str | None:
    """Return the name of the text with events in a zip archive; None if the archive is of another kind."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = [one.filename for one in archive.infolist() if not one.is_dir()]
    except _DAMAGED as error:
        raise DataError(f"is a zip archive that cannot be read: {error}", path) from None
    texts = [
        name
        for name in names
        if name.lower().endswith((".txt", ".csv", ".tsv")) and not name.startswith("__MACOSX")
    ]
    if layout.stream is not None:
        if layout.stream in names:
            return layout.stream
        raise DataError(f"holds no {layout.stream}, but {', '.join(names[:8])}", path)
    named = [name for name in texts if "event" in Path(name).name.lower()] or texts
    if len(named) > 1:
        raise DataError(
            f"is a zip archive of {len(named)} files that may hold events: {', '.join(named[:8])}; name one "
            "with --event-stream",
            path,
        )
    return named[0] if named else None


def _open_plain(path: Path) -> BinaryIO:
    return path.open("rb")


def _open_gzip(path: Path) -> BinaryIO:
    return gzip.open(path, "rb")  # type: ignore[return-value]


def _open_member(path: Path, member: str) -> BinaryIO:
    archive = zipfile.ZipFile(path)
    try:
        file = archive.open(member)
    finally:
        archive.close()  # the member keeps the file open
    return file  # type: ignore[return-value]


def _blocks(path: Path, begin: _Open, head: TextHead, damage: Damage) -> Iterator[Block]:
    """Yield the columns of whole lines, about `BLOCK_BYTES` at a time."""
    line, row = head.lines + 1, 0
    rest = b""
    try:
        with begin() as file:
            file.read(head.start)
            ended = False
            while not ended:
                read = file.read(BLOCK_BYTES)
                ended = not read
                data = rest + read
                end = len(data) if ended else data.rfind(b"\n") + 1
                if not ended and not end and len(data) > BLOCK_BYTES:
                    raise DataError("has a line without an end", path, line)
                data, rest = data[:end], data[end:]
                if not data.strip():
                    pass
                elif ended and len(_fields_of(data, head)) < len(head.words):
                    damage.tail_bytes = len(data)  # the last line has no end, and is cut off
                else:
                    block = _block(path, data, head, (line, row))
                    yield block
                    row += len(block.columns[0])
                line += data.count(b"\n")
    except _DAMAGED as error:
        raise DataError(f"is damaged near line {line}: {error}", path) from None


def _block(path: Path, data: bytes, head: TextHead, at: tuple[int, int]) -> Block:
    """Return the columns of some lines.

    Args:
        path: the file.
        data: the lines.
        head: what they look like.
        at: number of the first line, from 1, and of the first event, from 0.
    """
    line, row = at
    columns = _parsed(data, head)
    if columns is None:
        data = _plain(data, head.delimiter)
        columns = _parsed(data, head)
    if columns is None:
        raise _diagnosis(path, data, head, line)

    def line_of(place: int) -> int:
        filled = [k for k, text in enumerate(data.splitlines()) if text.strip()]
        return line + filled[place]

    return Block(columns, row, line_of)


def _parsed(data: bytes, head: TextHead) -> list[npt.NDArray[Any]] | None:
    """Return the columns of lines; None where one is not as the first ones."""
    import pyarrow as pa
    from pyarrow import csv

    names = [str(k) for k in range(len(head.words))]
    kinds = [pa.string() if word else pa.float64() for word in head.words]
    try:
        table = csv.read_csv(
            pa.BufferReader(data),
            read_options=csv.ReadOptions(column_names=names),
            parse_options=csv.ParseOptions(delimiter=head.delimiter.decode(), quote_char=False),
            convert_options=csv.ConvertOptions(
                column_types=dict(zip(names, kinds, strict=True)), null_values=[], strings_can_be_null=False
            ),
        )
    except (pa.ArrowException, UnicodeDecodeError):
        return None
    columns = []
    for word, column in zip(head.words, table.columns, strict=True):
        found = _polarity(column) if word else column.to_numpy()
        if found is None:
            return None
        columns.append(found)
    return columns


def _polarity(column: Any) -> npt.NDArray[np.float64] | None:
    encoded = column.combine_chunks().dictionary_encode()
    values = polarity_of_words(encoded.dictionary.to_pylist())
    return None if values is None else values[encoded.indices.to_numpy()]


def _plain(data: bytes, delimiter: bytes) -> bytes:
    """Leave one separator between two fields, and no white space around them."""
    data = re.sub(rb"(?m)^[ \t]+|[ \t]+(?=\r?$)", b"", data)
    if delimiter == b" ":
        return re.sub(rb"[ \t]+", b" ", data)
    return data if delimiter == b"\t" else re.sub(rb" *" + delimiter + rb" *", delimiter, data)


def _fields_of(line: bytes, head: TextHead) -> list[bytes]:
    return line.split() if head.delimiter == b" " else line.split(head.delimiter)


def _diagnosis(path: Path, data: bytes, head: TextHead, first: int) -> DataError:
    """Say which line is not as it should be."""
    for number, line in enumerate(data.splitlines(), first):
        if not line.strip():
            continue
        fields = _fields_of(line, head)
        shown = line[:60].decode("utf-8", "replace")
        if len(fields) != len(head.words):
            text = f"{len(fields)} fields, but the first event has {len(head.words)}: {shown!r}"
            return DataError(text, path, number)
        for word, field in zip(head.words, fields, strict=True):
            text = field.decode("utf-8", "replace")
            if (polarity_of_words([text]) if word else number_of(field)) is None:
                return DataError(
                    f"{text.strip()[:40]!r} is no {'polarity' if word else 'number'}", path, number
                )
    return DataError("cannot be read as text", path, first)
