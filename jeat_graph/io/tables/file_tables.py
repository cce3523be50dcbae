"""Reads CSV files with a header, and Parquet files, as tables with named columns."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.arrays import IntArray
from jeat_graph.data.column_names import standing_in, usual_names
from jeat_graph.data.tables.arrow_arrays import arrow_compute, from_numpy, to_numpy
from jeat_graph.data.tables.file_table import FileTable
from jeat_graph.io.tables.csv_text import TEXT, CsvBody, read_text
from jeat_graph.io.tables.headers import check_names, split_header
from jeat_graph.io.tables.parquet_columns import read_columns

PARQUET_SUFFIXES = (".parquet", ".pq")


def read_table(
    path: str | Path,
    required: Sequence[str],
    optional: Sequence[str] = (),
    *,
    short: Sequence[str] = (),
    aliases: bool = False,
    kinds: Mapping[str, str] | None = None,
) -> FileTable:
    """Read a CSV file with a header, or a Parquet file, by its suffix.

    Fields of CSV stand between commas, tabs, or semicolons; numbers may then have a decimal comma.

    Columns that are neither required nor optional are passed over, unless they look like a slip of the pen
    for a known column that is not there.

    Args:
        path: the file; `.parquet` and `.pq` are Parquet, all else is CSV.
        required: columns that must be there.
        optional: columns that may be there.
        short: a CSV line may stop after these columns, if they are the file's first ones.
        aliases: whether columns may go by other usual names, in upper or lower case (`column_names`), and
            whether others may stand for them: `right` for `width`, `frame` for `t`.
        kinds: what columns most likely hold (`csv_text.NUMBER`, `WORD`), by the name that they have after
            `aliases`; only quicker, and in less memory.

    Raises:
        DataError: the file cannot be read, or a column is missing, misspelt or there twice.
    """
    file = Path(path)
    if file.suffix.lower() in PARQUET_SUFFIXES:
        return FileTable(file, read_columns(file, required, optional, aliases))

    def lines() -> tuple[CsvBody, list[str]]:
        return _below_header(file, required, optional, short, aliases)

    body, header = lines()
    likely = kinds or {}
    parsed, columns = body.parse(
        [likely.get(name, TEXT) if body.delimiter == "," else TEXT for name in header]
    )
    repaired = parsed is not body

    def line_of(row: int) -> int:
        # The file is read once more for the one line that is wrong, rather than kept beside its columns.
        again, _ = lines()
        return (again.filled_up() if repaired else again).line_of_row(row)

    decimal_comma = body.delimiter != ","
    del body, parsed
    return _table(file, dict(zip(header, columns, strict=True)), line_of, decimal_comma=decimal_comma)


def _below_header(
    file: Path, required: Sequence[str], optional: Sequence[str], short: Sequence[str], aliases: bool
) -> tuple[CsvBody, list[str]]:
    """The lines of a CSV file below its header, and the columns' names."""
    data = read_text(file)
    header, end, line, delimiter = split_header(data, file)
    if aliases:
        header = usual_names(header, (*required, *optional))
        required, short = standing_in(header, required), standing_in(header, short)
    check_names(header, required, optional, file, line)
    leading = {name for name in short if name in header}
    stop = len(leading) if set(header[: len(leading)]) == leading else 0
    body = CsvBody(file, data, line + 1, len(header), "the header names", stop, delimiter, end)
    return body, header


def table_of(body: CsvBody, names: Sequence[str], columns: Sequence[Any]) -> FileTable:
    """Make a table of parsed CSV columns, without the rows in which every field is blank (`,,,`)."""
    named = dict(zip(names, columns, strict=True))
    return _table(body.path, named, body.line_of_row, decimal_comma=body.delimiter != ",")


def _table(
    path: Path, named: dict[str, Any], line_of: Callable[[int], int], *, decimal_comma: bool
) -> FileTable:
    """A table of Arrow columns without the rows in which every one is null; `line_of` counts these rows."""
    from functools import reduce

    compute = arrow_compute()

    rows: IntArray | None = None
    columns = list(named.values())
    if columns and all(column.null_count for column in columns):
        nothing = to_numpy(reduce(compute.and_, [column.is_null() for column in columns]))
        if nothing.any():
            rows = np.flatnonzero(~nothing)
            named = {name: column.take(from_numpy(rows)) for name, column in named.items()}
    return FileTable(
        path,
        named,
        lambda row: line_of(row if rows is None else int(rows[row])),
        decimal_comma=decimal_comma,
    )
