"""The list of scans that a run was made from: `scans.csv` in its directory.

A trajectory table cannot say that there was no track at a time; this list says that the tracker ran then.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.detections import Detections

#: Name of the file in a run directory.
SCANS = "scans.csv"


def write_scans(detections: Detections, path: str | Path) -> None:
    """Write `t, sensor, detections`, one row a scan, empty ones included."""
    from jeat_graph.io.tables.table_writer import write_columns

    names = np.asarray(detections.sensors, dtype=np.str_)
    columns: dict[str, Any] = {
        "t": detections.scan_t + 0.0,
        "sensor": names[detections.scan_sensor] if detections.num_scans else np.zeros(0, dtype=np.str_),
        "detections": np.diff(detections.scan_start),
    }
    write_columns(columns, path)


def read_instants(folder: str | Path) -> FloatArray | None:
    """Times at which the tracker of a run gave output, ascending (I,), or None if the run does not say.

    Raises:
        DataError: `scans.csv` is there but not valid, or a link to a file elsewhere.
    """
    from jeat_graph.io.files.beside import check_beside
    from jeat_graph.io.tables.file_tables import read_table

    path = Path(folder) / SCANS
    if not path.is_file():
        return None
    check_beside(path, folder)
    return np.unique(read_table(path, ("t", "sensor", "detections")).number("t"))
