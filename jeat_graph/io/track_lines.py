"""Tracks as lines of a stream: JSON, one line a step, or the rows of a causal table."""

from __future__ import annotations

import json
from typing import Any

from jeat_graph.data.trajectories import Trajectories
from jeat_graph.data.views import BOX, MEAN, VAR
from jeat_graph.io.table_writer import csv_lines
from jeat_graph.io.trajectories_io import COLUMNS, table_columns


def json_line(t: float, table: Trajectories) -> str:
    """Return the tracks of one moment as one line of JSON, numbers rounded as in `causal.csv`.

    `{"t": s, "tracks": [{"track_id", "box": [l, t, w, h], "existence", "mean": [x, y, vx, vy, ax, ay],
    "var": [the six variances], "sensors": [names used now]}, …]}`. Variances that are not known are null.

    Args:
        t: time of the step (s).
        table: its tracks, maybe none.
    """
    tracks: list[dict[str, Any]] = []
    if len(table):
        columns = {name: values.tolist() for name, values in table_columns(table).items()}
        for k in range(len(table)):
            var = [columns[name][k] for name in VAR]
            tracks.append(
                {
                    "track_id": columns["track_id"][k],
                    "box": [columns[name][k] for name in BOX],
                    "existence": columns["existence"][k],
                    "mean": [columns[name][k] for name in MEAN],
                    "var": [None if value != value else value for value in var],
                    "sensors": [name for s, name in enumerate(table.sensors) if table.used[k] >> s & 1],
                }
            )
    return json.dumps({"t": t, "tracks": tracks}, ensure_ascii=False, separators=(",", ":")) + "\n"


def csv_header() -> str:
    """Return the first line of a causal table."""
    return ",".join(COLUMNS) + "\n"


def csv_rows(table: Trajectories) -> str:
    """Return the rows of one moment, byte for byte as `causal.csv` has them."""
    return csv_lines(table_columns(table)) if len(table) else ""
