"""Trajectory tables from and to files: the run's own tables, and results of MOTChallenge and KITTI.

A run's table keeps times to the last bit, boxes and motion to 0.001 px (px/s, px/s²), existence to 1e-6 and
variances to six significant digits, in CSV and Parquet alike; the same table gives the same bytes.
"""

from __future__ import annotations

import graphlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.data.views import BOX, MEAN, VAR
from jeat_graph.io import kitti, motchallenge
from jeat_graph.io.file_table import FileTable
from jeat_graph.io.formats import recognise
from jeat_graph.io.frames import check_rate
from jeat_graph.io.piecewise import PiecewiseWriter
from jeat_graph.io.plain_text import frames_of
from jeat_graph.io.table_writer import TableWriter, round_decimals, round_significant, write_columns
from jeat_graph.io.tables import read_table

COLUMNS = ("t", "track_id", *BOX, "existence", *MEAN, *VAR, "sensors")
_PX_DECIMALS = 3
_EXISTENCE_DECIMALS = 6
_VAR_DIGITS = 6
_SCALE = np.repeat([10.0**_PX_DECIMALS, 10.0**_EXISTENCE_DECIMALS], [10, 1])
_JOINT = "|"
_FLUSH_ROWS = 8192
_MOST_SENSORS = 63  # bits of `Trajectories.used`


class TrajectoryWriter(PiecewiseWriter):
    """Write a table of the contract piece by piece, in bounded memory.

    Use it as a context manager. The file appears at `path` when the `with` block ends without an error, and
    its bytes do not depend on how the rows were cut into pieces.

    Args:
        path: the file; `.parquet` and `.pq` are Parquet, all else is CSV.
    """

    def __init__(self, path: str | Path) -> None:
        super().__init__()
        self._writer = TableWriter(path)
        self._pending: list[Trajectories] = []
        self._rows = 0

    def _begin(self) -> None:
        self._stack.enter_context(self._writer)
        self._writer.append(table_columns(Trajectories.empty()))  # a run without tracks has a header too

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
            self._writer.append(table_columns(Trajectories.concatenate(self._pending)))
        self._pending, self._rows = [], 0


def table_columns(table: Trajectories) -> dict[str, Any]:
    """Return the columns of the contract (N,) by name, rounded as they are written."""
    boxes, existence, mean, var = rounded(table)
    columns: dict[str, Any] = {"t": table.t + 0.0, "track_id": table.track_id}
    columns |= {name: boxes[:, k] for k, name in enumerate(BOX)}
    columns["existence"] = existence
    columns |= {name: mean[:, k] for k, name in enumerate(MEAN)}
    columns |= {name: var[:, k] for k, name in enumerate(VAR)}
    columns["sensors"] = np.asarray(table.sensor_text(), dtype=np.str_)
    return columns


def rounded(table: Trajectories) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return boxes (N, 4), existence (N,), mean (N, 6) and variances (N, 6), rounded as they are written."""
    # In one array: for the few tracks of one moment every call costs more than its arithmetic.
    values = np.concatenate([table.boxes, table.mean, table.existence[:, None]], axis=1)
    values = np.rint(values * _SCALE) / _SCALE + 0.0
    return values[:, :4], values[:, 10], values[:, 4:10], round_significant(table.var, _VAR_DIGITS)


def write_trajectories(table: Trajectories, path: str | Path) -> None:
    """Write a table of the contract as CSV, or as Parquet where the name ends so."""
    with TrajectoryWriter(path) as writer:
        writer.append(table)


def read_trajectories(
    path: str | Path, *, rate_hz: float | None = None, fmt: str | None = None
) -> Trajectories:
    """Read a table of the contract (CSV, Parquet), or a MOTChallenge or KITTI result.

    A result has boxes only. Its mean is then the box's centre with velocity and acceleration 0, its variances
    are NaN (see `has_motion`), and no sensor is named. Its confidence is the existence where it is in [0, 1];
    any other value (MOTChallenge writes -1 for unknown) counts as 1.

    Args:
        path: the file.
        rate_hz: frame rate of a result; see `read_truth`.
        fmt: the format, if it should not be recognised from the file.

    Raises:
        DataError: names the file, the line or row, and what is wrong, such as a track twice at one time.
    """
    kind = recognise(path, fmt, ("csv", "parquet", "motchallenge", "kitti"))
    if kind == "motchallenge":
        table = motchallenge.read_lines(path)
        rate, _ = motchallenge.sequence_rate(path, rate_hz)
        frame = frames_of(table, motchallenge.FIRST_FRAME) - motchallenge.FIRST_FRAME
        found = _without_motion(table, frame / rate, motchallenge.boxes_of(table), "conf")
    elif kind == "kitti":
        table = kitti.read_lines(path)
        rate = check_rate(kitti.RATE_HZ if rate_hz is None else rate_hz, path)
        frame = frames_of(table, kitti.FIRST_FRAME)
        found = _without_motion(table, frame / rate, kitti.boxes_of(table), "score")
    else:
        table = read_table(path, COLUMNS)
        found = _read_contract(table)
    _check(table, found)
    return found


def has_motion(table: Trajectories) -> bool:
    """Tell whether a table holds estimates of motion, rather than boxes only (then all variances are NaN)."""
    return bool(np.isfinite(table.var).any())


def write_motchallenge(table: Trajectories, path: str | Path, rate_hz: float) -> None:
    """Write boxes as a MOTChallenge result: `frame, id, left, top, width, height, existence, -1, -1, -1`.

    Times go to the nearest frame, counted from 1; sampling the table at frame times is the caller's business.
    Of several rows of one track in one frame the last is written.

    Raises:
        DataError: the rate is not positive, or a time lies before frame 1.
    """
    frame, kept = by_frame(table, path, rate_hz)
    boxes = round_decimals(kept.boxes, _PX_DECIMALS)
    columns: dict[str, Any] = {"frame": frame + motchallenge.FIRST_FRAME, "id": kept.track_id}
    columns |= {name: boxes[:, k] for k, name in enumerate(BOX)}
    columns["conf"] = round_decimals(kept.existence, _EXISTENCE_DECIMALS)
    columns |= {name: np.full(len(kept), -1) for name in ("world_x", "world_y", "world_z")}
    write_columns(columns, path, header=False)


def write_kitti(
    table: Trajectories, path: str | Path, rate_hz: float = kitti.RATE_HZ, object_type: str = "Car"
) -> None:
    """Write boxes as a KITTI tracking result, frames from 0, the 3D columns marked as unknown.

    Rows are chosen as by `write_motchallenge`; the score is the existence.

    Raises:
        DataError: the rate is not positive, a time lies before frame 0, or the type holds white space.
    """
    if object_type.split() != [object_type]:
        raise DataError(f"a KITTI object type is one word, not {object_type!r}", path)
    frame, kept = by_frame(table, path, rate_hz)
    n = len(kept)
    edges = np.concatenate([kept.boxes[:, :2], kept.boxes[:, :2] + kept.boxes[:, 2:]], axis=1)
    edges = round_decimals(edges, _PX_DECIMALS)
    columns: dict[str, Any] = {"frame": frame, "id": kept.track_id, "type": np.full(n, object_type)}
    columns |= {
        name: np.full(n, value) for name, value in (("truncated", -1), ("occluded", -1), ("alpha", -10))
    }
    columns |= {name: edges[:, k] for k, name in enumerate(("left", "top", "right", "bottom"))}
    columns |= {f"size_{name}": np.full(n, -1) for name in "hwl"}
    columns |= {f"loc_{name}": np.full(n, -1000) for name in "xyz"}
    columns |= {"rotation": np.full(n, -10), "score": round_decimals(kept.existence, _EXISTENCE_DECIMALS)}
    write_columns(columns, path, header=False, delimiter=" ")


def by_frame(table: Trajectories, path: str | Path, rate_hz: float) -> tuple[IntArray, Trajectories]:
    """Return frames (from 0) and rows, sorted by frame and id, the last row of each pair only."""
    frame = np.rint(table.t * check_rate(rate_hz, path)).astype(np.int64)
    if (frame < 0).any():
        raise DataError(f"t = {table.t.min():g} lies before the first frame, which is at 0 s", path)
    order = np.lexsort((np.arange(len(frame)), table.track_id, frame))
    last = np.ones(len(order), dtype=bool)
    last[:-1] = (np.diff(frame[order]) != 0) | (np.diff(table.track_id[order]) != 0)
    rows = order[last]
    return frame[rows], table.take(rows)


def _read_contract(table: FileTable) -> Trajectories:
    text = table.text("sensors", blank_ok=True)
    distinct, index = np.unique(text, return_inverse=True)
    sensors = _sensor_order(distinct.tolist())
    if len(sensors) > _MOST_SENSORS:
        raise DataError(f"names {len(sensors)} sensors; at most {_MOST_SENSORS} can be kept", table.path)
    bit = {name: 1 << k for k, name in enumerate(sensors)}
    mask = [sum(bit[name] for name in set(words.split(_JOINT)) if name) for words in distinct.tolist()]
    return Trajectories(
        t=table.number("t"),
        track_id=table.whole("track_id"),
        boxes=_stack(table, BOX),
        existence=table.number("existence"),
        mean=_stack(table, MEAN),
        var=np.stack([table.number(name, blank_ok=True, nan_ok=True) for name in VAR], axis=1),
        used=np.asarray(mask, dtype=np.int64)[index.reshape(-1)],
        sensors=sensors,
    )


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


def _without_motion(table: FileTable, t: FloatArray, boxes: FloatArray, score: str) -> Trajectories:
    n = len(t)
    existence = table.number(score) if score in table else np.ones(n)
    mean = np.zeros((n, 6))
    mean[:, :2] = boxes[:, :2] + boxes[:, 2:] / 2
    return Trajectories(
        t=t,
        track_id=table.whole("id"),
        boxes=boxes,
        existence=np.where((existence >= 0) & (existence <= 1), existence, 1.0),
        mean=mean,
        var=np.full((n, 6), np.nan),
        used=np.zeros(n, dtype=np.int64),
    )


def _stack(table: FileTable, names: Iterable[str]) -> FloatArray:
    return np.stack([table.number(name) for name in names], axis=1)


def _check(table: FileTable, found: Trajectories) -> None:
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
