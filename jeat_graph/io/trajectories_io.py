"""Trajectory tables from and to files: the run's own tables; results of other trackers are read too.

A run's table keeps times to the last bit, boxes and motion to 0.001 px (px/s, px/s²), existence to 1e-6 and
variances to six significant digits, in CSV and Parquet alike; the same table gives the same bytes.
"""

from __future__ import annotations

import graphlib
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.class_columns import class_column, unknown_classes
from jeat_graph.data.column_names import BOX, standing_in
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.data.views import MEAN, SIZE_VAR, VAR
from jeat_graph.io.box_rows import FileBoxes, read_rows
from jeat_graph.io.file_table import FileTable
from jeat_graph.io.formats import known_columns, recognise
from jeat_graph.io.piecewise import PiecewiseWriter
from jeat_graph.io.reading import Reading, ReadingOptions
from jeat_graph.io.result_tables import NO_IDENTITIES, RESULT_COLUMNS, read_result_table
from jeat_graph.io.rounding import round_decimals, round_significant
from jeat_graph.io.table_writer import TableWriter
from jeat_graph.io.tables import read_table

#: Columns that a table must have; those behind them where the detections have classes; the last ones, which
#: older tables lack.
COLUMNS = ("t", "track_id", *BOX, "existence", *MEAN, *VAR, "sensors")
CLASS_COLUMNS = ("class", "class_probability")
SIZE_COLUMNS = SIZE_VAR
#: Decimals that boxes, motion, and probabilities are written with.
PX_DECIMALS = 3
EXISTENCE_DECIMALS = 6
_VAR_DIGITS = 6
_SCALE = np.repeat([10.0**PX_DECIMALS, 10.0**EXISTENCE_DECIMALS], [10, 1])
_JOINT = "|"
_TABLES = ("csv", "parquet")
# A file of white space only is no larger.
_BLANK_BYTES = 100
_FLUSH_ROWS = 8192
_MOST_SENSORS = 63  # bits of `Trajectories.used`


class TrajectoryWriter(PiecewiseWriter):
    """Write a table of the contract piece by piece, in bounded memory.

    Use it as a context manager. The file appears at `path` when the `with` block ends without an error, and
    its bytes do not depend on how the rows were cut into pieces.

    Args:
        path: the file; `.parquet` and `.pq` are Parquet, all else is CSV.
        classes: whether it has the columns of classes; where it has not, those of the tables are left out.
    """

    def __init__(self, path: str | Path, *, classes: bool = False) -> None:
        super().__init__()
        self._classes = classes
        self._writer = TableWriter(path)
        self._pending: list[Trajectories] = []
        self._rows = 0

    def _begin(self) -> None:
        self._stack.enter_context(self._writer)
        self._writer.append(table_columns(Trajectories.empty(), self._classes))

    def _finish(self) -> None:
        self._flush()

    def append(self, table: Trajectories) -> None:
        """Add the rows of a table, which is copied: the caller may use its arrays again.

        Raises:
            DataError: a sensor's name holds `|`, which joins the names in the column `sensors`.
        """
        if self._pending and self._pending[0].sensors != table.sensors:
            self._flush()
        joint = next((name for name in table.sensors if _JOINT in name), None)
        if joint is not None:
            raise DataError(f"the name of sensor {joint!r} must not hold {_JOINT!r}")
        self._pending.append(Trajectories.concatenate([table]))
        self._rows += len(table)
        if self._rows >= _FLUSH_ROWS or len(self._pending) >= _FLUSH_ROWS:
            self._flush()

    def _flush(self) -> None:
        """Convert what has come together: tables of a few rows each would cost far more one by one."""
        if self._pending:
            self._writer.append(table_columns(Trajectories.concatenate(self._pending), self._classes))
        self._pending, self._rows = [], 0


def table_columns(table: Trajectories, classes: bool | None = None) -> dict[str, Any]:
    """Return the columns of the contract (N,) by name, rounded as they are written.

    Args:
        table: the rows.
        classes: whether those of classes are among them; by default where the table has such.
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
        columns |= {"class": names, "class_probability": round_decimals(share, EXISTENCE_DECIMALS)}
    columns |= {name: size_var[:, k] for k, name in enumerate(SIZE_COLUMNS)}
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
    """Write a table of the contract as CSV, or as Parquet where the name ends so."""
    with TrajectoryWriter(path, classes=table.classes is not None) as writer:
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
        options: what a result does not say itself, as `io.reading.Reading` has it: `rate_hz`, `first_frame`,
            `video`, `class_names`, `image`, `time_unit`.

    Raises:
        DataError: names the file, the line or row, and what is wrong, such as a track twice at one time.
    """
    return read_trajectories_counted(path, fmt, Reading(**options))[0]


def read_trajectories_counted(
    path: str | Path, fmt: str | None, how: Reading
) -> tuple[Trajectories, int | None]:
    """Read as `read_trajectories` does, and tell the first frame's number where the format leaves it open."""
    kind = recognise(path, fmt)
    if kind in _TABLES:
        if Path(path).stat().st_size < _BLANK_BYTES and not Path(path).read_bytes().strip():
            return Trajectories.empty(), None
        if not _is_result(path):
            table = read_table(path, COLUMNS, (*CLASS_COLUMNS, *SIZE_COLUMNS))
            found = _read_contract(table)
            _check(table, found)
            return found, None
    rows = read_rows(path, kind, how) if kind not in _TABLES else read_result_table(path, how)
    found = _without_motion(rows, path)
    _check(rows, found)
    return found, rows.first


def _is_result(path: str | Path) -> bool:
    """Whether a table is another tracker's: it has boxes, and nothing that only our own tables have."""
    names = known_columns(path, RESULT_COLUMNS)
    boxes = set(standing_in(names, BOX)) <= set(names)
    return boxes and not {"existence", "sensors", *VAR} & set(names)


def _read_contract(table: FileTable) -> Trajectories:
    text = table.text("sensors", blank_ok=True)
    distinct, index = np.unique(text, return_inverse=True)
    sensors = _sensor_order(distinct.tolist())
    if len(sensors) > _MOST_SENSORS:
        raise DataError(f"names {len(sensors)} sensors; at most {_MOST_SENSORS} can be kept", table.path)
    bit = {name: 1 << k for k, name in enumerate(sensors)}
    mask = [sum(bit[name] for name in set(words.split(_JOINT)) if name) for words in distinct.tolist()]
    stated = all(name in table for name in SIZE_COLUMNS)
    return Trajectories(
        t=table.number("t"),
        track_id=table.whole("track_id"),
        boxes=_stack(table, BOX),
        existence=table.number("existence"),
        mean=_stack(table, MEAN),
        var=_variances(table, VAR),
        size_var=_variances(table, SIZE_COLUMNS) if stated else np.full((len(table), 2), np.nan),
        used=np.asarray(mask, dtype=np.int64)[index.reshape(-1)],
        sensors=sensors,
        **_classes_of(table),
    )


def _variances(table: FileTable, names: tuple[str, ...]) -> FloatArray:
    return np.stack([table.number(name, blank_ok=True, nan_ok=True) for name in names], axis=1)


def _classes_of(table: FileTable) -> dict[str, Any]:
    if "class" not in table:
        return {}
    share = None
    if "class_probability" in table:
        share = table.number("class_probability", blank_ok=True, nan_ok=True)
    return class_column(table.text("class", blank_ok=True), share)


def _sensor_order(texts: Iterable[str]) -> tuple[str, ...]:
    """Find an order of the sensors that agrees with each text, so that writing gives the same texts again."""
    after: dict[str, set[str]] = {}
    for text in texts:
        names = [name for name in text.split(_JOINT) if name]
        for k, name in enumerate(names):
            after.setdefault(name, set()).update(names[k - 1 : k])
    ordered = {name: sorted(after[name]) for name in sorted(after)}
    try:
        return tuple(graphlib.TopologicalSorter(ordered).static_order())
    except graphlib.CycleError:
        return tuple(ordered)


def _without_motion(rows: FileBoxes, path: str | Path) -> Trajectories:
    n = len(rows.t)
    if n and (rows.ids is None or (n > 1 and (rows.ids < 0).all())):
        raise DataError(NO_IDENTITIES, path)
    ids = np.zeros(0, dtype=np.int64) if rows.ids is None else rows.ids
    existence = np.ones(n) if rows.scores is None else rows.scores
    mean = np.zeros((n, 6))
    mean[:, :2] = rows.boxes[:, :2] + rows.boxes[:, 2:] / 2
    found = Trajectories(
        t=rows.t,
        track_id=ids,
        boxes=rows.boxes,
        existence=np.where((existence >= 0) & (existence <= 1), existence, 1.0),
        mean=mean,
        var=np.full((n, 6), np.nan),
        used=np.zeros(n, dtype=np.int64),
    )
    return replace(found, **class_column(rows.classes, None))


def _stack(table: FileTable, names: Iterable[str]) -> FloatArray:
    return np.stack([table.number(name) for name in names], axis=1)


def _check(table: FileTable | FileBoxes, found: Trajectories) -> None:
    negative = (found.boxes[:, 2:] < 0).any(axis=1)
    if negative.any():
        row = int(np.argmax(negative))
        raise table.error(row, f"width and height must not be negative, got {found.boxes[row, 2:].tolist()}")
    outside = (found.existence < 0) | (found.existence > 1)
    if outside.any():
        row = int(np.argmax(outside))
        raise table.error(row, f"existence must be in [0, 1], got {found.existence[row]:g}")
    order = np.lexsort((np.arange(len(found)), found.track_id, found.t))
    same = (np.diff(found.t[order]) == 0) & (np.diff(found.track_id[order]) == 0)
    if same.any():
        row = int(order[1:][same].min())
        raise table.error(row, f"track {found.track_id[row]} is there twice at t = {found.t[row]:g}")
