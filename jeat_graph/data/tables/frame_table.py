"""Data frames (pandas, polars, Arrow) as the tables that files are read as."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_columns import collected, named_columns
from jeat_graph.data.tables.arrow_arrays import arrow_compute
from jeat_graph.data.tables.file_table import FileTable


def table_of_frame(frame: Any, required: Sequence[str], optional: Sequence[str], what: str) -> FileTable:
    """Return the columns of a data frame that are known, as those of a file.

    Args:
        frame: the data frame.
        required: columns that must be there, or others that can stand for them.
        optional: columns that may be there.
        what: what the frame is to be, for messages.

    Raises:
        DataError: it is no data frame; a column is missing or there twice.
    """
    frame = collected(frame)
    if not hasattr(frame, "columns"):
        raise DataError(f"{what} are read from a data frame, not from {type(frame).__name__}")
    columns = named_columns(frame, required, optional, what)
    known = {name: _arrow(column) for name, column in columns.items()}
    return FileTable(None, known, first_row=0)


def _arrow(column: Any) -> Any:
    """Return a column as Arrow's, null where it has no value; what is of several kinds as text."""
    import pyarrow as pa

    compute = arrow_compute()

    if not isinstance(column, pa.Array | pa.ChunkedArray):
        column = column.to_arrow() if hasattr(column, "to_arrow") else _from_objects(column)
    column = column if isinstance(column, pa.ChunkedArray) else pa.chunked_array([column])
    if pa.types.is_floating(column.type):
        column = column.cast(pa.float64())
        column = compute.if_else(compute.is_nan(column), pa.scalar(None, pa.float64()), column)
    return column


def _from_objects(column: Any) -> Any:
    import pyarrow as pa

    try:
        return pa.array(column, from_pandas=True)
    except (pa.ArrowException, TypeError, ValueError, OverflowError):
        values = np.asarray(column, dtype=object).tolist()
        return pa.array([None if one is None or one != one else str(one) for one in values], pa.string())
