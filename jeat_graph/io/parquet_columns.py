"""The columns of a Parquet file, as Arrow arrays, under the names that readers know."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jeat_graph.data.column_names import standing_in, usual_names
from jeat_graph.data.errors import DataError
from jeat_graph.io.csv_text import read_bytes
from jeat_graph.io.headers import check_names
from jeat_graph.io.limits import check_room

_BYTES_PER_VALUE = 24  # as Arrow holds a number, as the reader converts it, and as scans hold it


def read_columns(
    path: Path, required: Sequence[str], optional: Sequence[str], aliases: bool
) -> dict[str, Any]:
    """Read the columns that are known, by name; NaN becomes null.

    Args:
        path: the file.
        required: columns that must be there.
        optional: columns that may be there.
        aliases: whether other usual names stand for these (`column_names`).

    Raises:
        DataError: no Parquet file, a column is missing or misspelt, or it claims more rows than memory holds.
    """
    import pyarrow as pa
    from pyarrow import compute, parquet

    data = read_bytes(path)
    if not data:
        raise DataError("is empty", path)
    try:
        file = parquet.ParquetFile(pa.BufferReader(data))
        own = file.schema_arrow.names
        names = own
        if aliases:
            names = usual_names(own, (*required, *optional))
            required = standing_in(names, required)
        check_names(names, required, optional, path, None)
        chosen = {name: own[names.index(name)] for name in (*required, *optional) if name in names}
        # A column that repeats one value claims any number of rows in a few bytes.
        check_room(file.metadata.num_rows * len(chosen) * _BYTES_PER_VALUE, path)
        table = file.read(list(chosen.values()))
    except (pa.ArrowException, OSError, UnicodeDecodeError, MemoryError, OverflowError) as error:
        reason = (str(error) or "not enough memory").splitlines()[0][:200]
        raise DataError(f"cannot be read as Parquet: {reason}", path) from None
    columns = {name: table.column(there) for name, there in chosen.items()}
    for name, column in columns.items():
        if pa.types.is_floating(column.type):
            # Tables made from arrays have NaN where tables made from rows have null.
            columns[name] = compute.if_else(compute.is_nan(column), pa.scalar(None, column.type), column)
    return columns
