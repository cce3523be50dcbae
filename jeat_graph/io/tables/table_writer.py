"""Write tables to CSV or Parquet, piece by piece, the same bytes however the rows are cut into pieces."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy.typing as npt

from jeat_graph.data.errors import DataError
from jeat_graph.data.tables.arrow_arrays import from_numpy
from jeat_graph.data.tables.spreadsheets import guarded_column
from jeat_graph.data.tables.vector_columns import lists_as_text
from jeat_graph.io.files.atomic import atomic_path
from jeat_graph.io.files.piecewise import PiecewiseWriter
from jeat_graph.io.tables.file_tables import PARQUET_SUFFIXES

# Rows kept in memory, and a Parquet row group. Fixed, because the bytes of a Parquet file depend on it.
_CHUNK_ROWS = 1 << 16


class TableWriter(PiecewiseWriter):
    """A context manager that writes rows and makes the file visible only when it is complete.

    NaN, masked entries and empty text become blank fields (CSV) or nulls (Parquet, but for the text). Numbers
    are written with as few digits as give the same number back. In CSV, what a spreadsheet would take for a
    formula has an apostrophe before it (`spreadsheets`).

    Args:
        path: the file; `.parquet` and `.pq` are Parquet, all else is text.
        header: whether the first line of a text file names the columns.
        delimiter: one character between the fields of a text file.
    """

    def __init__(self, path: str | Path, *, header: bool = True, delimiter: str = ",") -> None:
        super().__init__()
        self._path = Path(path)
        self._header = header
        self._delimiter = delimiter
        self._parquet = self._path.suffix.lower() in PARQUET_SUFFIXES
        self._pending: list[Any] = []
        self._rows = 0
        self._sink: Any = None
        self._target: Path | None = None

    def _begin(self) -> None:
        self._target = self._stack.enter_context(atomic_path(self._path))

    def _finish(self) -> None:
        self._write(everything=True)

    def append(self, columns: Mapping[str, npt.NDArray[Any]]) -> None:
        """Add rows; every call gives the same columns in the same order.

        Args:
            columns: arrays (R,) of numbers or text by name; masked arrays where whole numbers are missing.
        """
        import pyarrow as pa

        if self._target is None:
            raise RuntimeError("the writer must be entered with `with` before rows are appended")
        arrays = [from_numpy(values) for values in columns.values()]
        self._pending.append(pa.table(arrays, names=list(columns)))
        self._rows += len(self._pending[-1])
        if self._rows >= _CHUNK_ROWS:
            self._write(everything=False)

    def _write(self, everything: bool) -> None:
        import pyarrow as pa

        if not self._pending:
            return
        table = pa.concat_tables(self._pending)
        end = len(table) if everything else len(table) - len(table) % _CHUNK_ROWS
        sink = self._sink = self._opened(table.schema) if self._sink is None else self._sink
        for start in range(0, end, _CHUNK_ROWS):
            # In one chunk: Arrow 20 to 22 writes the rows before an empty chunk twice to CSV.
            part = table.slice(start, min(_CHUNK_ROWS, end - start)).combine_chunks()
            if self._parquet:
                sink.write_table(part)
            else:
                sink.write(_csv_bytes(part, self._delimiter))
        self._pending = [table.slice(end)]
        self._rows = len(table) - end

    def _opened(self, schema: Any) -> Any:
        assert self._target is not None
        if self._parquet:
            from pyarrow import parquet

            return self._stack.enter_context(parquet.ParquetWriter(self._target, schema))
        sink = self._stack.enter_context(self._target.open("wb"))
        if self._header:
            sink.write((self._delimiter.join(schema.names) + "\n").encode())
        return sink


def write_columns(
    columns: Mapping[str, npt.NDArray[Any]], path: str | Path, *, header: bool = True, delimiter: str = ","
) -> None:
    """Write one table in one go (see `TableWriter`)."""
    with TableWriter(path, header=header, delimiter=delimiter) as writer:
        writer.append(columns)


def csv_lines(columns: Mapping[str, npt.NDArray[Any]], delimiter: str = ",") -> str:
    """Return the lines of a text file with these rows, without its header, just as they would be written."""
    import pyarrow as pa

    table = pa.table([from_numpy(values) for values in columns.values()], names=list(columns))
    return _csv_bytes(table, delimiter).decode("utf-8")


def _csv_bytes(table: Any, delimiter: str) -> bytes:
    import pyarrow as pa
    from pyarrow import csv as arrow_csv

    for k, field in enumerate(table.schema):
        if pa.types.is_list(field.type):
            table = table.set_column(k, field.name, lists_as_text(table.column(k)))
        elif delimiter == "," and pa.types.is_string(field.type):
            table = table.set_column(k, field.name, guarded_column(table.column(k)))
    # Arrow quotes either all text or none, and refuses "none" where a text holds a comma or a quote.
    for style in ("none", "needed"):
        buffer = pa.BufferOutputStream()
        options = arrow_csv.WriteOptions(include_header=False, delimiter=delimiter, quoting_style=style)
        try:
            arrow_csv.write_csv(table, buffer, options)
        except pa.ArrowInvalid as error:
            if style == "needed":
                raise DataError(f"cannot be written as CSV: {error}") from None
            continue
        return bytes(buffer.getvalue())
    raise AssertionError("one of the two styles returns or raises")
