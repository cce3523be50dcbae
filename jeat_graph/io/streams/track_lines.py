"""Tracks as lines of a stream: JSON, one line a step, or the rows of a causal table."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from jeat_graph.data.column_names import SIZE_VAR
from jeat_graph.data.tables.trajectory_table import COLUMNS, RUN_CLASSES, RUN_IDENTITIES
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.tables.table_writer import csv_lines
from jeat_graph.io.tables.trajectories_io import EXISTENCE_DECIMALS, rounded, table_columns

_ENCODER = json.JSONEncoder(ensure_ascii=False, separators=(",", ":"), check_circular=False)


def json_line(t: float, table: Trajectories) -> str:
    """Return the tracks of one moment as one line of JSON, numbers rounded as in `causal.csv`.

    `{"t": s, "tracks": [{"track_id", "box": [l, t, w, h], "existence", "mean": [x, y, vx, vy, ax, ay],
    "var": [the six variances], "size_var": [those of width and height], "sensors": [names used now]}, …]}`.
    Variances that are not known are null.
    Where detections have classes, `"class"` and `"class_probability"` follow, null where nothing names one.

    Args:
        t: time of the step (s).
        table: its tracks, maybe none.
    """
    tracks: list[dict[str, Any]] = []
    if len(table):
        boxes, existence, mean, var, size_var = (values.tolist() for values in rounded(table))
        known = not (np.isnan(table.var).any() or np.isnan(table.size_var).any())
        names = {
            used: [name for s, name in enumerate(table.sensors) if used >> s & 1]
            for used in set(table.used.tolist())
        }
        for k, (track_id, used) in enumerate(zip(table.track_id.tolist(), table.used.tolist(), strict=True)):
            tracks.append(
                {
                    "track_id": track_id,
                    "box": boxes[k],
                    "existence": existence[k],
                    "mean": mean[k],
                    "var": var[k] if known else _nulls(var[k]),
                    "size_var": size_var[k] if known else _nulls(size_var[k]),
                    "sensors": names[used],
                }
            )
            if table.classes is not None and table.class_probability is not None:
                kind, share = str(table.classes[k]), float(table.class_probability[k])
                share_text = None if share != share else round(share, EXISTENCE_DECIMALS)
                tracks[-1] |= {"class": kind or None, "class_probability": share_text}
    return _ENCODER.encode({"t": t, "tracks": tracks}) + "\n"


def _nulls(values: list[float]) -> list[float | None]:
    return [None if value != value else value for value in values]


def csv_header(classes: bool = False, identities: bool = False) -> str:
    """Return the first line of a table, with or without the columns of classes and of decided identities."""
    more = (*SIZE_VAR, *(RUN_IDENTITIES if identities else ()))
    return ",".join((*COLUMNS, *(RUN_CLASSES if classes else ()), *more)) + "\n"


def csv_rows(table: Trajectories, classes: bool = False) -> str:
    """Return the rows of one moment, byte for byte as `causal.csv` or `smoothed.csv` has them."""
    return csv_lines(table_columns(table, classes)) if len(table) else ""
