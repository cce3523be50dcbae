"""The detections that confirmed tracks took in, `measurements.parquet`: each as the filter weighed it.

With them a run can be smoothed again in other ways without tracking its recording again.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from jeat_graph.data.arrays import RecordArray
from jeat_graph.filters.measurement import MEASUREMENT
from jeat_graph.io.tables.file_tables import read_table
from jeat_graph.io.tables.table_writer import TableWriter

_AXES = {"log_size": ("width", "height"), "size_var": ("width", "height")}


def _columns_of(field: str) -> tuple[str, ...]:
    """Names of the columns that hold a field of `MEASUREMENT`: one, or one for each axis."""
    if not MEASUREMENT[field].shape:
        return (field,)
    return tuple(f"{field}_{axis}" for axis in _AXES.get(field, ("x", "y")))


COLUMNS = tuple(column for field in MEASUREMENT.names or () for column in _columns_of(field))
_MAY_BE_BLANK = ("nis",)


class MeasurementWriter:
    """Write the records piece by piece, in bounded memory; a context manager.

    Args:
        path: the file; `.parquet` and `.pq` are Parquet, all else is CSV.
        sensors: names of the sensors that the records count.
    """

    def __init__(self, path: str | Path, sensors: Sequence[str]) -> None:
        self._writer = TableWriter(path)
        self._sensors = np.asarray(sensors, dtype=np.str_)

    def __enter__(self) -> Self:
        self._writer.__enter__()
        self.append(np.zeros(0, dtype=MEASUREMENT))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._writer.__exit__(kind, error, trace)

    def append(self, rows: RecordArray) -> None:
        """Add records (M,)."""
        columns: dict[str, Any] = {}
        for field in MEASUREMENT.names or ():
            names, values = _columns_of(field), rows[field]
            if field == "sensor":
                columns[field] = self._sensors[values] if len(rows) else np.zeros(0, dtype=np.str_)
            elif len(names) == 1:
                columns[field] = np.ascontiguousarray(values)
            else:
                columns |= {name: values[:, k].copy() for k, name in enumerate(names)}
        self._writer.append(columns)


def read_measurements(path: str | Path, sensors: Sequence[str]) -> RecordArray:
    """Read records (M,) in the order of the file.

    Args:
        path: the file.
        sensors: names of the sensors, in the order in which the records shall count them.

    Raises:
        DataError: names the file, the row, and what is wrong.
    """
    table = read_table(path, COLUMNS)
    rows = np.zeros(len(table), dtype=MEASUREMENT)
    for field in MEASUREMENT.names or ():
        names = _columns_of(field)
        if field == "sensor":
            rows[field] = _numbered(table, sensors)
        elif np.issubdtype(MEASUREMENT[field].base, np.integer):
            if len(names) == 1:
                rows[field] = table.whole(field)
            else:
                rows[field] = np.column_stack([table.whole(name) for name in names])
        elif len(names) == 1:
            rows[field] = table.number(field, blank_ok=field in _MAY_BE_BLANK)
        else:
            for k, name in enumerate(names):
                rows[field][:, k] = table.number(name)
    return rows


def _numbered(table: Any, sensors: Sequence[str]) -> Any:
    """Return the number of each row's sensor (M,)."""
    names = table.text("sensor")
    number = np.full(len(names), -1, dtype=np.int64)
    for k, sensor in enumerate(sensors):
        number[names == sensor] = k
    if (number < 0).any():
        row = int(np.argmin(number))
        raise table.error(row, f"sensor {names[row]!s} is not one of the run's: {', '.join(sensors)}")
    return number
