"""Trajectory tables from and to files: the run's own tables; results of other trackers are read too.

A run's table keeps times to the last bit, boxes and motion to 0.001 px (px/s, px/s²), existence to 1e-6 and
variances to six significant digits, in CSV as in Parquet; the same table gives the same bytes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Unpack

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.class_columns import unknown_classes
from jeat_graph.data.column_names import BOX, MEAN, SIZE_VAR, VAR
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_numbers import FrameCount, note_first
from jeat_graph.data.tables.reading import Reading, ReadingOptions
from jeat_graph.data.tables.trajectory_table import (
    COLUMNS,
    JOINT,
    MORE_COLUMNS,
    NO_IDENTITIES,
    RESULT_COLUMNS,
    RUN_CLASSES,
    RUN_IDENTITIES,
    bare_fields,
    check_tracks,
    is_result,
    run_fields,
)
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.files.piecewise import PiecewiseWriter
from jeat_graph.io.formats.record import FileBoxes
from jeat_graph.io.formats.registry import recognise
from jeat_graph.io.tables.file_tables import read_table
from jeat_graph.io.tables.known_columns import known_columns
from jeat_graph.io.tables.result_tables import read_result_table
from jeat_graph.io.tables.rounding import round_decimals, round_significant
from jeat_graph.io.tables.table_writer import TableWriter

#: Decimals that boxes, motion, and probabilities are written with.
PX_DECIMALS = 3
EXISTENCE_DECIMALS = 6
_VAR_DIGITS = 6
_SCALE = np.repeat([10.0**PX_DECIMALS, 10.0**EXISTENCE_DECIMALS], [10, 1])
# A file of white space only is no larger.
_BLANK_BYTES = 100
_FLUSH_ROWS = 8192


class TrajectoryWriter(PiecewiseWriter):
    """Write a table of the contract piece by piece, in bounded memory.

    Use it as a context manager. The file appears at `path` when the `with` block ends without an error, and
    its bytes do not depend on how the rows were cut into pieces.

    Args:
        path: the file; `.parquet` and `.pq` are Parquet, all else is CSV.
        classes: whether it has the columns of classes; where it has not, those of the tables are left out.
        identities: the same of those of identities that were decided again.
    """

    def __init__(self, path: str | Path, *, classes: bool = False, identities: bool = False) -> None:
        super().__init__()
        self._classes, self._identities = classes, identities
        self._writer = TableWriter(path)
        self._pending: list[Trajectories] = []
        self._rows = 0

    def _begin(self) -> None:
        self._stack.enter_context(self._writer)
        self._writer.append(table_columns(Trajectories.empty(), self._classes, self._identities))

    def _finish(self) -> None:
        self._flush()

    def append(self, table: Trajectories) -> None:
        """Add the rows of a table, which is copied: the caller may use its arrays again.

        Raises:
            DataError: a sensor's name holds `|`, which joins the names in the column `sensors`.
        """
        if self._pending and self._pending[0].sensors != table.sensors:
            self._flush()
        joint = next((name for name in table.sensors if JOINT in name), None)
        if joint is not None:
            raise DataError(f"the name of sensor {joint!r} must not hold {JOINT!r}")
        self._pending.append(Trajectories.concatenate([table]))
        self._rows += len(table)
        if self._rows >= _FLUSH_ROWS or len(self._pending) >= _FLUSH_ROWS:
            self._flush()

    def _flush(self) -> None:
        """Convert what has come together: tables of a few rows each would cost far more one by one."""
        if self._pending:
            self._writer.append(
                table_columns(Trajectories.concatenate(self._pending), self._classes, self._identities)
            )
        self._pending, self._rows = [], 0


def table_columns(
    table: Trajectories, classes: bool | None = None, identities: bool | None = None
) -> dict[str, Any]:
    """Return the columns of the contract (N,) by name, rounded as they are written.

    Args:
        table: the rows.
        classes: whether those of classes are among them; by default where the table has such.
        identities: the same of those of identities that were decided again.
    """
    boxes, existence, mean, var, size_var = rounded(table)
    columns: dict[str, Any] = {"t": table.t + 0.0, "track_id": table.track_id}
    columns |= {name: boxes[:, k] for k, name in enumerate(BOX)}
    columns["existence"] = existence
    columns |= {name: mean[:, k] for k, name in enumerate(MEAN)}
    columns |= {name: var[:, k] for k, name in enumerate(VAR)}
    columns["sensors"] = np.asarray(table.sensor_text(), dtype=np.str_)
    if table.classes is not None if classes is None else classes:
        names, share = unknown_classes(len(table))
        if table.classes is not None and table.class_probability is not None:
            names, share = table.classes, table.class_probability
        columns |= dict(zip(RUN_CLASSES, (names, round_decimals(share, EXISTENCE_DECIMALS)), strict=True))
    columns |= {name: size_var[:, k] for k, name in enumerate(SIZE_VAR)}
    if table.causal_id is not None if identities is None else identities:
        causal, share = table.track_id, np.ones(len(table))
        if table.causal_id is not None and table.identity_probability is not None:
            causal, share = table.causal_id, table.identity_probability
        columns |= dict(zip(RUN_IDENTITIES, (causal, round_decimals(share, EXISTENCE_DECIMALS)), strict=True))
    return columns


def rounded(table: Trajectories) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return what is written, rounded as it is written.

    Returns:
        Boxes (N, 4), existence (N,), mean (N, 6), its variances (N, 6) and those of width and height (N, 2).
    """
    # In one array: for the few tracks of one moment every call costs more than its arithmetic.
    values = np.concatenate([table.boxes, table.mean, table.existence[:, None]], axis=1)
    values = np.rint(values * _SCALE) / _SCALE + 0.0
    var = round_significant(np.concatenate([table.var, table.size_var], axis=1), _VAR_DIGITS)
    return values[:, :4], values[:, 10], values[:, 4:10], var[:, :6], var[:, 6:]


def write_trajectories(table: Trajectories, path: str | Path) -> None:
    """Write a table of the contract as CSV, or as Parquet where the name ends in `.parquet` or `.pq`.

    Raises:
        DataError: the name ends in `.txt`, as results of MOTChallenge and KITTI do: these are written by
            the `write` of their records in `jeat_graph.io.formats`; or a sensor's name holds `|`.
    """
    if Path(path).suffix.lower() == ".txt":
        raise DataError(
            "this writes CSV or Parquet; text by frame is written by the `write` of a format, see "
            "written_formats() of jeat_graph.io.formats.registry",
            path,
        )
    decided = table.causal_id is not None
    with TrajectoryWriter(path, classes=table.classes is not None, identities=decided) as writer:
        writer.append(table)


def read_trajectories(
    path: str | Path, *, fmt: str | None = None, **options: Unpack[ReadingOptions]
) -> Trajectories:
    """Read a table of the contract (CSV, Parquet), or another tracker's result in any format of detections.

    A result has boxes with identities only. Its mean is then the box's centre with velocity and acceleration
    0, its variances are NaN, and no sensor is named. Its confidence is the existence where it is in [0, 1];
    any other value (MOTChallenge writes -1 for unknown) counts as 1. A file without any line is a result
    without tracks.

    Args:
        path: the file, or the folder of YOLO's labels.
        fmt: the format, if it should not be recognised from the file.
        options: what a result does not say itself, as `tables.reading.Reading` has it: `rate_hz`,
            `first_frame`, `video`, `class_names`, `image`, `time_unit`.

    Raises:
        DataError: names the file, the line or row, and what is wrong, such as a track twice at one time.
    """
    how = Reading(**options)
    table, count = read_trajectories_counted(path, fmt, how)
    note_first(str(path), count, how.first_frame)
    return table


def read_trajectories_counted(
    path: str | Path, fmt: str | None, how: Reading
) -> tuple[Trajectories, FrameCount | None]:
    """Read as `read_trajectories` does, and tell the frame numbers of a file that counts frames."""
    kind = recognise(path, fmt)
    if kind.is_table:
        if Path(path).stat().st_size < _BLANK_BYTES and not Path(path).read_bytes().strip():
            return Trajectories.empty(), None
        if not is_result(known_columns(path, RESULT_COLUMNS)):
            table = read_table(path, COLUMNS, MORE_COLUMNS)
            fields = run_fields(table)
            check_tracks(table.error, fields)
            return Trajectories(**fields), None
    rows = read_result_table(path, how) if kind.is_table else kind.read_boxes(path, how)
    fields = _without_motion(rows, path)
    check_tracks(rows.error, fields)
    return Trajectories(**fields), rows.frames


def _without_motion(rows: FileBoxes, path: str | Path) -> dict[str, Any]:
    """Fields of tracks of which a file of boxes says no more than these."""
    n = len(rows.t)
    if n and (rows.ids is None or (n > 1 and (rows.ids < 0).all())):
        raise DataError(NO_IDENTITIES, path)
    ids = np.zeros(0, dtype=np.int64) if rows.ids is None else rows.ids
    scores = np.ones(n) if rows.scores is None else rows.scores
    return bare_fields(rows.t, ids, rows.boxes, scores, rows.classes)
