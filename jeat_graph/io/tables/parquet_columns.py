"""The columns of a Parquet file, as Arrow arrays, under the names that readers know."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jeat_graph.data.column_names import standing_in, usual_names
from jeat_graph.data.errors import DataError
from jeat_graph.data.tables.arrow_arrays import arrow_compute
from jeat_graph.io.files.limits import check_room
from jeat_graph.io.files.unpacking import check_unpacked
from jeat_graph.io.tables.csv_text import read_bytes
from jeat_graph.io.tables.headers import check_names

_BYTES_PER_VALUE = 24  # as Arrow holds a number, as the reader converts it, and as scans hold it
# A row of a table has a place that is not that of any other, so it takes a byte at least.
_MOST_PER_BYTE, _FEW_VALUES = 50, 10_000_000
_LONGEST_TEXT = 4096  # a name of a sensor or class has fewer bytes


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
    from pyarrow import parquet

    compute = arrow_compute()

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
        rows = file.metadata.num_rows
        check_room(rows * len(chosen) * _BYTES_PER_VALUE, path)
        if rows * len(chosen) > max(_MOST_PER_BYTE * len(data), _FEW_VALUES):
            raise DataError(f"claims {rows} rows in {len(data)} bytes; no recording does", path)
        groups = [file.metadata.row_group(k) for k in range(file.metadata.num_row_groups)]
        check_unpacked(sum(group.total_byte_size for group in groups), len(data), path)
        table = _read(data, list(chosen.values()), path)
    except (pa.ArrowException, OSError, KeyError, UnicodeDecodeError, MemoryError, OverflowError) as error:
        reason = (str(error) or "not enough memory").splitlines()[0][:200]
        raise DataError(f"cannot be read as Parquet: {reason}", path) from None
    columns = {name: table.column(there) for name, there in chosen.items()}
    for name, column in columns.items():
        if pa.types.is_floating(column.type):
            # Tables made from arrays have NaN where tables made from rows have null.
            columns[name] = compute.if_else(compute.is_nan(column), pa.scalar(None, column.type), column)
    return columns


def _read(data: bytes, chosen: list[str], path: Path) -> Any:
    """Read columns; those of text as a dictionary first, for one long text may stand in any number of rows.

    Raises:
        DataError: a text is too long for a name.
    """
    import pyarrow as pa
    from pyarrow import parquet

    compute = arrow_compute()

    kinds = {name: parquet.read_schema(pa.BufferReader(data)).field(name).type for name in chosen}
    plain = [
        name for name, kind in kinds.items() if pa.types.is_string(kind) or pa.types.is_large_string(kind)
    ]
    texts = [*plain, *(name for name, kind in kinds.items() if pa.types.is_dictionary(kind))]
    table = parquet.ParquetFile(pa.BufferReader(data), read_dictionary=plain).read(chosen)
    for name in texts:
        column = table.column(name)
        kind = column.type.value_type if pa.types.is_dictionary(column.type) else column.type
        for chunk in column.chunks:
            values = chunk.dictionary if pa.types.is_dictionary(chunk.type) else chunk
            is_text = pa.types.is_string(values.type) or pa.types.is_large_string(values.type)
            longest = (compute.max(compute.binary_length(values)).as_py() or 0) if is_text else 0
            if longest > _LONGEST_TEXT:
                raise DataError(f"{name}: a text of {longest} bytes is no name", path)
        table = table.set_column(table.schema.get_field_index(name), name, column.cast(kind))
    return table
