"""Corrected identities from a file, and the disagreements to `disagreements.csv`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from jeat_graph.data.corrected_tracks import CorrectedTracks, Disagreements
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_numbers import note_first
from jeat_graph.data.tables.reading import Reading
from jeat_graph.data.tables.trajectory_table import (
    COLUMNS,
    MORE_COLUMNS,
    MORE_RESULT_COLUMNS,
    NO_IDENTITIES,
    RESULT_COLUMNS,
    check_tracks,
    rows_of_result,
)
from jeat_graph.io.formats.registry import recognise
from jeat_graph.io.tables.file_tables import read_table
from jeat_graph.io.tables.rounding import round_decimals
from jeat_graph.io.tables.table_writer import write_columns

#: What our own tables have beside times, identities and boxes; a person may leave any of it out.
_OURS = tuple(name for name in (*COLUMNS, *MORE_COLUMNS) if name not in ("track_id", *RESULT_COLUMNS))
_DECIMALS = 3


def read_corrected(path: str | Path, how: Reading) -> CorrectedTracks:
    """Read tracks that a person has corrected: a table, or any other format of results.

    A table has `t, track_id, left, top, width, height`. Of one of ours, `sensors` tells which rows the model
    wrote without a detection.

    Args:
        path: the file.
        how: what it does not say itself.

    Raises:
        DataError: names the file, the line or row, and what is wrong.
    """
    kind = recognise(path, None)
    if kind.is_table:
        rows = _read_table(path, how)
    else:
        found = kind.read_boxes(path, how)
        note_first(str(path), found.frames, how.first_frame)
        if found.ids is None or (found.ids < 0).all():
            raise DataError(NO_IDENTITIES, path)
        rows = CorrectedTracks(
            found.t, found.ids, found.boxes, np.zeros(len(found.t), dtype=bool), found.error
        )
    if not len(rows.t):
        raise DataError("has no tracks", path)
    negative = rows.track_id < 0
    if negative.any():
        row = int(np.argmax(negative))
        raise rows.error(row, f"track_id must not be negative, got {rows.track_id[row]}")
    flat = ~(rows.boxes[:, 2:] > 0).all(axis=1)
    if flat.any():
        row = int(np.argmax(flat))
        width, height = rows.boxes[row, 2:]
        raise rows.error(row, f"width and height must be positive, got {width:g} x {height:g}")
    fields = {"boxes": rows.boxes, "existence": np.ones(len(rows.t)), "t": rows.t, "track_id": rows.track_id}
    check_tracks(rows.error, fields)
    return rows


def _read_table(path: str | Path, how: Reading) -> CorrectedTracks:
    more = (*_OURS, *(name for name in MORE_RESULT_COLUMNS if name not in _OURS))
    try:
        table = read_table(path, RESULT_COLUMNS, more, short=("t",), aliases=True)
    except DataError as error:
        if not error.message.startswith("column 'object_id' is missing"):
            raise
        message = "has no column track_id; corrected tracks are t, track_id, left, top, width, height"
        raise DataError(message, error.path, error.line) from None
    found = rows_of_result(table, how, None)
    coasts = np.zeros(len(found.t), dtype=bool)
    if "sensors" in table and "existence" in table:
        # A row that a person adds has neither.
        written = ~table.blank("existence")
        coasts = (written & table.blank("sensors"))[found.rows]
    return CorrectedTracks(
        found.t,
        found.ids,
        found.boxes,
        coasts,
        lambda row, message: table.error(int(found.rows[row]), message),
    )


def write_disagreements(rows: Disagreements, path: str | Path) -> None:
    """Write rows that the model disagrees with; `sigma` is blank where there is no smoothed track."""
    columns = {
        "t": rows.t + 0.0,
        "track_id": rows.track_id,
        "sigma": round_decimals(rows.sigma, _DECIMALS),
        "what": np.asarray(rows.what, dtype=np.str_),
    }
    write_columns(columns, path)
