"""CSV as text: bytes to columns of text by Arrow, and the exact line of whatever is wrong.

Arrow reads a million lines in well under a second but cannot say where it failed. So a file is read by Arrow,
and only when something is wrong it is walked through once more, slowly, to find the line.
"""

from __future__ import annotations

import csv
import io
import re
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

from jeat_graph.data.errors import DataError
from jeat_graph.io.files.limits import check_file
from jeat_graph.io.files.not_tables import what_it_is
from jeat_graph.io.files.unpacking import check_unpacked, most_unpacked

_BOM = b"\xef\xbb\xbf"
_WIDE_BOMS = (b"\xff\xfe", b"\xfe\xff")
_GZIP = b"\x1f\x8b"
_SOMETHING = re.compile(rb"\S")
_NO_LINE_END = re.compile(rb"[^\r\n]")
#: How a column is read where all its fields allow it: as numbers, or as text of which there are few kinds.
NUMBER, WORD, TEXT = "number", "word", "text"


def read_bytes(path: str | Path) -> bytes:
    """Return a file's bytes.

    Raises:
        DataError: there is no such file, it is no file (`limits.check_file`), or it cannot be read.
    """
    check_file(path)
    try:
        return Path(path).read_bytes()
    except (OSError, ValueError) as error:
        raise DataError(f"cannot be read: {error}", path) from None


def read_text(path: str | Path, *, blank_ok: bool = False) -> bytes:
    """Return a text file's bytes as UTF-8 without a byte order mark.

    Args:
        path: the file.
        blank_ok: whether it may be empty.

    Raises:
        DataError: as `read_bytes`; the file is empty, not UTF-8, or holds NUL bytes.
    """
    data = read_bytes(path)
    if Path(path).suffix.lower() == ".gz" and data.startswith(_GZIP):
        data = _unpacked(data, path)
    other = what_it_is(data)
    if other is not None:
        raise DataError(other, path)
    if data.startswith(_WIDE_BOMS):
        raise DataError("is UTF-16; save it as UTF-8", path)
    data = data.removeprefix(_BOM)
    if not blank_ok and not _SOMETHING.search(data):
        raise DataError("is empty", path)
    if b"\0" in data:
        raise DataError("is not text (NUL byte)", path, line_at(data, data.index(b"\0")))
    return data


def _unpacked(data: bytes, path: str | Path, most: int | None = None) -> bytes:
    """Unpack gzip, in one or several members; with `most`, only the first bytes."""
    out: list[bytes] = []
    size, packed = 0, len(data)
    limit = most_unpacked(packed) if most is None else most
    complete = False
    try:
        while not complete:
            member = zlib.decompressobj(wbits=zlib.MAX_WBITS | 16)
            out.append(member.decompress(data, max(limit - size, 1)))
            size += len(out[-1])
            if not member.eof:
                break
            data = member.unused_data.lstrip(b"\0")
            complete = not data
    except zlib.error as error:
        raise DataError(f"cannot be unpacked: {error}", path) from None
    if most is None and not complete:
        check_unpacked(size + (size >= limit), packed, path)
        raise DataError("is cut off (gzip)", path)
    return b"".join(out)


def first_bytes(path: str | Path, count: int) -> bytes:
    """Return the first bytes of a file, unpacked where its name ends in `.gz`.

    Raises:
        OSError: it cannot be read.
        DataError: it cannot be unpacked.
    """
    with Path(path).open("rb") as file:
        head = file.read(count)
    packed = Path(path).suffix.lower() == ".gz" and head.startswith(_GZIP)
    return _unpacked(head, path, count) if packed else head


def line_at(data: bytes, offset: int) -> int:
    r"""Return the number, from 1, of the line at a byte offset; \n, \r\n and \r all end a line."""
    return (
        1 + data.count(b"\n", 0, offset) + data.count(b"\r", 0, offset) - data.count(b"\r\n", 0, offset + 1)
    )


@dataclass(frozen=True, eq=False)
class CsvBody:
    """The lines of a CSV file below its header, or all lines of a file without one.

    Attributes:
        path: the file, for messages.
        data: bytes of the file, UTF-8.
        start: where in them the lines begin; a copy without what is before them would need as much again.
        first_line: number of the first of these lines in the file, from 1.
        width: fields that each line must have.
        wanted: where `width` comes from, such as "the header names", for messages.
        short: a line may also stop after this many fields, the others then being blank; 0 for never.
        delimiter: what stands between two fields, one character.
    """

    path: Path
    data: bytes
    first_line: int
    width: int
    wanted: str
    short: int = 0
    delimiter: str = ","
    start: int = 0

    def parse(self, kinds: Sequence[str] = ()) -> tuple[CsvBody, list[Any]]:
        """Split into columns.

        Args:
            kinds: of each column, `NUMBER`, `WORD` or `TEXT`; all are text where a field is not of its kind,
                so that whoever converts it can say which one.

        Returns:
            The body that was parsed at last (short lines filled up), and per column an Arrow array (R,),
            null where a field is blank; lines without any character are not rows.

        Raises:
            DataError: names the first line with a wrong number of fields, or that is not UTF-8.
        """
        import pyarrow as pa

        for ways in (kinds, ()) if kinds else ((),):
            try:
                return self, self._arrow_columns(ways)
            except (pa.ArrowException, UnicodeDecodeError):
                pass
        repaired = self.filled_up()
        if kinds:
            try:
                return repaired, repaired._arrow_columns(kinds)
            except (pa.ArrowException, UnicodeDecodeError):
                pass
        try:
            return repaired, repaired._arrow_columns(())
        except (pa.ArrowException, UnicodeDecodeError) as error:
            raise repaired._diagnosis(error) from None

    def line_of_row(self, row: int) -> int:
        """Return the line number of a row (from 0) of the columns; rows that are quite empty do not count."""
        return next(islice(self._records(), row, None), (self.first_line, []))[0]

    def _arrow_columns(self, kinds: Sequence[str]) -> list[Any]:
        import pyarrow as pa
        from pyarrow import csv as arrow_csv

        names = [str(k) for k in range(self.width)]
        if not _NO_LINE_END.search(self.data, self.start):
            return [pa.chunked_array([], type=pa.string()) for _ in names]
        types = {NUMBER: pa.float64(), WORD: pa.dictionary(pa.int32(), pa.string()), TEXT: pa.string()}
        chosen = [types[kind] for kind in kinds or [TEXT] * self.width]
        table = arrow_csv.read_csv(
            pa.BufferReader(pa.py_buffer(self.data).slice(self.start)),
            read_options=arrow_csv.ReadOptions(column_names=names),
            parse_options=arrow_csv.ParseOptions(
                delimiter=self.delimiter, newlines_in_values=self.data.find(b'"', self.start) >= 0
            ),
            convert_options=arrow_csv.ConvertOptions(
                column_types=dict(zip(names, chosen, strict=True)),
                null_values=[""],
                strings_can_be_null=True,
            ),
        )
        return list(table.columns)

    def filled_up(self) -> CsvBody:
        """Empty lines of white space, give short lines their commas, take a comma too many; lines stay."""
        blank = rb"(?m)^ +(?=\r?$)" if self.delimiter == "\t" else rb"(?m)^[ \t]+(?=\r?$)"
        data = re.sub(blank, b"", self.data[self.start :])
        if 0 < self.short < self.width:
            mark = self.delimiter.encode()
            field = rb"[^" + mark + rb'"\r\n]+'
            line = rb"(?m)^(" + mark.join([field] * self.short) + rb")(?=\r?$)"
            data = re.sub(line, rb"\g<1>" + mark * (self.width - self.short), data)
        mark = re.escape(self.delimiter.encode())
        field = rb"[^" + mark + rb'"\r\n]*'
        full = rb"(?m)^(" + mark.join([field] * self.width) + rb")" + mark + rb"(?=\r?$)"
        data = re.sub(full, rb"\g<1>", data)
        return replace(self, data=data, start=0, short=0)

    def _records(self) -> Iterator[tuple[int, list[str]]]:
        """Yield (line number, fields) of each row, by Python's own reader."""
        # Decoded piece by piece: a line without an end does not become four bytes a character.
        source = io.BytesIO(self.data)
        source.seek(self.start)
        text = io.TextIOWrapper(source, "utf-8", errors="replace", newline="")
        reader = csv.reader(text, delimiter=self.delimiter)
        line = self.first_line
        while True:
            try:
                fields = next(reader, None)
            except csv.Error as error:
                raise DataError(f"cannot be read: {error}", self.path, line) from None
            if fields is None:
                return
            if fields:
                yield line, fields
            line = self.first_line + reader.line_num

    def _diagnosis(self, error: Exception) -> DataError:
        """Say which line made the reader fail."""
        data = self.data[self.start :]
        try:
            data.decode("utf-8")
        except UnicodeDecodeError as bad:
            line = self.first_line + line_at(data, bad.start) - 1
            return DataError("is not UTF-8; save the file as UTF-8", self.path, line)
        try:
            for line, fields in self._records():
                if len(fields) != self.width:
                    noun = "field" if len(fields) == 1 else "fields"
                    return DataError(f"{len(fields)} {noun}, but {self.wanted} {self.width}", self.path, line)
        except DataError as bad_record:
            return bad_record
        return DataError(f"cannot be read as CSV: {str(error).splitlines()[0][:200]}", self.path)
