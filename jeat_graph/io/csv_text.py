"""CSV as text: bytes to columns of text by Arrow, and the exact line of whatever is wrong.

Arrow reads a million lines in well under a second but cannot say where it failed. So a file is read by Arrow,
and only when something is wrong it is walked through once more, slowly, to find the line.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from jeat_graph.data.errors import DataError

_BOM = b"\xef\xbb\xbf"
_WIDE_BOMS = (b"\xff\xfe", b"\xfe\xff")


def read_bytes(path: str | Path) -> bytes:
    """Return a file's bytes.

    Raises:
        DataError: there is no such file, it is a folder, or it cannot be read.
    """
    file = Path(path)
    try:
        return file.read_bytes()
    except FileNotFoundError:
        raise DataError("no such file", path) from None
    except IsADirectoryError:
        raise DataError("is a folder; give a file", path) from None
    except (OSError, ValueError) as error:
        raise DataError(f"cannot be read: {error}", path) from None


def read_text(path: str | Path) -> bytes:
    """Return a text file's bytes as UTF-8 without a byte order mark.

    Raises:
        DataError: as `read_bytes`; the file is empty, not UTF-8, or holds NUL bytes.
    """
    data = read_bytes(path)
    if data.startswith(_WIDE_BOMS):
        raise DataError("is UTF-16; save it as UTF-8", path)
    data = data.removeprefix(_BOM)
    if not data.strip():
        raise DataError("is empty", path)
    if b"\0" in data:
        raise DataError("is not text (NUL byte)", path, line_at(data, data.index(b"\0")))
    return data


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
        data: the lines, UTF-8, comma-separated.
        first_line: number of the first of these lines in the file, from 1.
        width: fields that each line must have.
        wanted: where `width` comes from, such as "the header names", for messages.
        short: a line may also stop after this many fields, the others then being blank; 0 for never.
    """

    path: Path
    data: bytes
    first_line: int
    width: int
    wanted: str
    short: int = 0

    def parse(self) -> tuple[CsvBody, list[Any]]:
        """Split into columns of text.

        Returns:
            The body that was parsed at last (short lines filled up), and per column an Arrow array of text
            (R,), null where a field is blank; lines without any character are not rows.

        Raises:
            DataError: names the first line with a wrong number of fields, or that is not UTF-8.
        """
        import pyarrow as pa

        try:
            return self, self._arrow_columns()
        except (pa.ArrowException, UnicodeDecodeError):
            pass
        repaired = self._filled_up()
        try:
            return repaired, repaired._arrow_columns()
        except (pa.ArrowException, UnicodeDecodeError) as error:
            raise repaired._diagnosis(error) from None

    def line_of_row(self, row: int) -> int:
        """Return the line number of a row (from 0) of the columns; rows that are quite empty do not count."""
        return next(islice(self._records(), row, None), (self.first_line, []))[0]

    def _arrow_columns(self) -> list[Any]:
        import pyarrow as pa
        from pyarrow import csv as arrow_csv

        names = [str(k) for k in range(self.width)]
        if not self.data.strip(b"\r\n"):
            return [pa.chunked_array([], type=pa.string()) for _ in names]
        table = arrow_csv.read_csv(
            pa.BufferReader(self.data),
            read_options=arrow_csv.ReadOptions(column_names=names),
            parse_options=arrow_csv.ParseOptions(newlines_in_values=b'"' in self.data),
            convert_options=arrow_csv.ConvertOptions(
                column_types=dict.fromkeys(names, pa.string()), null_values=[""], strings_can_be_null=True
            ),
        )
        return list(table.columns)

    def _filled_up(self) -> CsvBody:
        """Empty the lines of white space only, and give short lines their commas; line numbers stay."""
        data = re.sub(rb"(?m)^[ \t]+(?=\r?$)", b"", self.data)
        if 0 < self.short < self.width:
            field = rb'[^,"\r\n]+'
            line = rb"(?m)^(" + rb",".join([field] * self.short) + rb")(?=\r?$)"
            data = re.sub(line, rb"\g<1>" + b"," * (self.width - self.short), data)
        return CsvBody(self.path, data, self.first_line, self.width, self.wanted, 0)

    def _records(self) -> Iterator[tuple[int, list[str]]]:
        """Yield (line number, fields) of each row, by Python's own reader."""
        text = io.StringIO(self.data.decode("utf-8", errors="replace"), newline="")
        reader = csv.reader(text)
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
        try:
            self.data.decode("utf-8")
        except UnicodeDecodeError as bad:
            line = self.first_line + line_at(self.data, bad.start) - 1
            return DataError("is not UTF-8; save the file as UTF-8", self.path, line)
        try:
            for line, fields in self._records():
                if len(fields) != self.width:
                    noun = "field" if len(fields) == 1 else "fields"
                    return DataError(f"{len(fields)} {noun}, but {self.wanted} {self.width}", self.path, line)
        except DataError as bad_record:
            return bad_record
        return DataError(f"cannot be read as CSV: {str(error).splitlines()[0][:200]}", self.path)
