"""Which columns a table has, without reading it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from jeat_graph.data.column_names import FRAME_COLUMNS, standing_in, usual_names
from jeat_graph.io.tables.csv_text import first_bytes
from jeat_graph.io.tables.file_tables import PARQUET_SUFFIXES
from jeat_graph.io.tables.headers import split_header

_BOM = b"\xef\xbb\xbf"
_HEADER_BYTES = 1 << 16


def known_columns(path: str | Path, known: Sequence[str]) -> list[str]:
    """Return the columns of a table by the names that readers know; none where it has no header.

    Args:
        path: CSV or Parquet.
        known: columns that the reader asks for, see `usual_names`.
    """
    try:
        if Path(path).suffix.lower() in PARQUET_SUFFIXES:
            from pyarrow import parquet

            names = parquet.read_schema(path).names
        else:
            head = first_bytes(path, _HEADER_BYTES).removeprefix(_BOM)
            names = split_header(head, Path(path)).names if head.strip() else []
    except Exception:  # whoever reads the whole file says what is wrong with it
        return []
    return usual_names(names, known)


def table_counts_frames(path: str | Path) -> bool:
    """Tell whether a table counts frames and says no times."""
    return standing_in(known_columns(path, ("t",)), ["t"])[0] in FRAME_COLUMNS
