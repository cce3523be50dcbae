"""Parquet: the same tables as CSV, with types and without lines."""

from __future__ import annotations

from jeat_graph.io.formats.record import BoxFormat, Certainty, FileHead
from jeat_graph.io.tables.file_tables import PARQUET_SUFFIXES
from jeat_graph.io.tables.known_columns import table_counts_frames

_MAGIC = b"PAR1"


def _recognise(head: FileHead) -> Certainty:
    if head.data.startswith(_MAGIC):
        return Certainty.SAYS
    return Certainty.NAMED if head.suffix in PARQUET_SUFFIXES else Certainty.NONE


FORMAT = BoxFormat(
    name="parquet",
    title="Parquet",
    reads="the columns of CSV",
    recognise=_recognise,
    read=None,
    counts_frames=table_counts_frames,
    suffix=".parquet",
)
