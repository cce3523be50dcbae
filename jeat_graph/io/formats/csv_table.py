"""CSV with a header: the tables of this program and of others, whose columns are known by their names."""

from __future__ import annotations

from jeat_graph.io.formats.record import BoxFormat, Certainty, FileHead
from jeat_graph.io.tables.known_columns import table_counts_frames

_SUFFIXES = (".csv", ".tsv")


def _recognise(head: FileHead) -> Certainty:
    return Certainty.NAMED if head.suffix in _SUFFIXES else Certainty.POSSIBLE


FORMAT = BoxFormat(
    name="csv",
    title="CSV",
    reads="`t` (s), `sensor`, `left, top, width, height` (px), `score` (0 to 1), optional `class`, "
    "`left_std, top_std, right_std, bottom_std` (px), `embedding` and `camera_motion`; rows in any "
    "order (their order changes nothing but the numbers of "
    "tracks)",
    recognise=_recognise,
    read=None,
    counts_frames=table_counts_frames,
    suffix=".csv",
)
