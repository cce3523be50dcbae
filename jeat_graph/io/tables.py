"""Reads CSV files with a header, and Parquet files, as tables with named columns."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.arrays import IntArray
from jeat_graph.io.column_names import standing_in, usual_names
from jeat_graph.io.csv_text import CsvBody, read_text
from jeat_graph.io.file_table import FileTable
from jeat_graph.io.headers import check_names, split_header
from jeat_graph.io.parquet_columns import read_columns

PARQUET_SUFFIXES = (".parquet", ".pq")


def read_table(
    path: str | Path,
    required: Sequence[str],
    optional: Sequence[str] = (),
    *,
    short: Sequence[str] = (),
    aliases: bool = False,
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

    Raises:
        DataError: the file cannot be read, or a column is missing, misspelt or there twice.
    """
    file = Path(path)
    if file.suffix.lower() in PARQUET_SUFFIXES:
        return FileTable(file, read_columns(file, required, optional, aliases))
    names, body, line, delimiter = split_header(read_text(file), file)
    header = names
    if aliases:
        header = usual_names(names, (*required, *optional))
        required, short = standing_in(header, required), standing_in(header, short)
    check_names(header, required, optional, file, line)
    leading = {name for name in short if name in header}
    stop = len(leading) if set(header[: len(leading)]) == leading else 0
    lines = CsvBody(file, body, line + 1, len(header), "the header names", stop, delimiter)
    parsed, columns = lines.parse()
    return table_of(parsed, header, columns)


def table_of(body: CsvBody, names: Sequence[str], columns: Sequence[Any]) -> FileTable:
    """Make a table of parsed CSV columns, without the rows in which every field is blank (`,,,`)."""
    from functools import reduce

    from pyarrow import compute

    named = dict(zip(names, columns, strict=True))
    rows: IntArray | None = None
    if columns and columns[0].null_count:
        nothing = reduce(compute.and_, [column.is_null() for column in columns]).to_numpy()
        if nothing.any():
            rows = np.flatnonzero(~nothing)
            named = {name: column.take(rows) for name, column in named.items()}
    return FileTable(
        body.path,
        named,
        lambda row: body.line_of_row(row if rows is None else int(rows[row])),
        decimal_comma=body.delimiter != ",",
    )
