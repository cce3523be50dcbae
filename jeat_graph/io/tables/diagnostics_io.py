"""The table of diagnostics of a run, `diagnostics.csv`: one row for each detection that a track took."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.diagnostics import Diagnostics
from jeat_graph.io.files.piecewise import PiecewiseWriter
from jeat_graph.io.tables.file_tables import read_table
from jeat_graph.io.tables.rounding import round_decimals, round_significant
from jeat_graph.io.tables.table_writer import TableWriter

COLUMNS = ("t", "track_id", "sensor", "nis", "noise_scale", "existence")
_DIGITS = 6
_EXISTENCE_DECIMALS = 6
_FLUSH_ROWS = 8192


class DiagnosticsWriter(PiecewiseWriter):
    """Write the table piece by piece, in bounded memory; a context manager, as `TrajectoryWriter`.

    Args:
        path: the file; `.parquet` and `.pq` are Parquet, all else is CSV.
    """

    def __init__(self, path: str | Path) -> None:
        super().__init__()
        self._writer = TableWriter(path)
        self._pending: list[Diagnostics] = []
        self._rows = 0

    def _begin(self) -> None:
        self._stack.enter_context(self._writer)
        self._writer.append(_columns(Diagnostics.concatenate([])))

    def _finish(self) -> None:
        self._flush()

    def append(self, table: Diagnostics) -> None:
        """Add the rows of one step."""
        if not len(table):
            return
        self._pending.append(table)
        self._rows += len(table)
        if self._rows >= _FLUSH_ROWS:
            self._flush()

    def _flush(self) -> None:
        if self._pending:
            self._writer.append(_columns(Diagnostics.concatenate(self._pending)))
        self._pending, self._rows = [], 0


def read_diagnostics(path: str | Path) -> Diagnostics:
    """Read the table of a run.

    Raises:
        DataError: names the file, the line or row, and what is wrong.
    """
    table = read_table(path, COLUMNS)
    sensors, index = np.unique(table.text("sensor"), return_inverse=True)
    nis = table.number("nis", blank_ok=True)
    scale, existence = table.number("noise_scale"), table.number("existence", blank_ok=True)
    for name, wrong, right in (
        ("nis", nis < 0.0, "must not be negative"),
        ("noise_scale", scale <= 0.0, "must be positive"),
        ("existence", (existence < 0.0) | (existence > 1.0), "must be in [0, 1]"),
    ):
        if wrong.any():
            raise table.error(int(np.argmax(wrong)), f"{name} {right}")
    return Diagnostics(
        t=table.number("t"),
        track_id=table.whole("track_id"),
        sensor=index.reshape(-1).astype(np.int64),
        nis=nis,
        noise_scale=scale,
        existence=existence,
        sensors=tuple(str(name) for name in sensors),
    )


def _columns(table: Diagnostics) -> dict[str, Any]:
    names = np.asarray(table.sensors, dtype=np.str_)
    return {
        "t": table.t + 0.0,
        "track_id": table.track_id,
        "sensor": names[table.sensor] if len(table) else np.zeros(0, dtype=np.str_),
        "nis": round_significant(table.nis, _DIGITS),
        "noise_scale": round_significant(table.noise_scale, _DIGITS),
        "existence": round_decimals(table.existence, _EXISTENCE_DECIMALS),
    }
