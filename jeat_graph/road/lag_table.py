"""Rows of the road a fixed lag behind: as the tables have them, each as soon as it is final.

What `track` writes with `smoother.road=fixed-lag`, and `stream` while vehicles drive by.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray, IntArray, RecordArray
from jeat_graph.data.errors import DataError, JeatGraphError
from jeat_graph.io.files.growing import GrowingFile
from jeat_graph.io.files.pipe_writer import never
from jeat_graph.io.tables.table_writer import csv_lines
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.causal import CalibrationShare, columns_of_rows
from jeat_graph.road.fixed_lag import RoadFixedLag, RoadLagConfig
from jeat_graph.road.results import empty_road_columns

Columns = dict[str, npt.NDArray[Any]]
# So many identities may be remembered without a look at which are still needed.
_FEW = 1000


class RoadLagTable:
    """All vehicles' rows a fixed lag behind; feed it what each step of a tracker gave to its tracks.

    Args:
        camera: the camera.
        lag_s: how far behind a row is final (s): as the picture's smoother has it, `smoother.lag_s`.
    """

    def __init__(self, camera: RoadCamera, lag_s: float) -> None:
        self._lag = RoadFixedLag(camera, RoadLagConfig(lag_s=lag_s))
        self._share = CalibrationShare(camera)

    def step(self, t: float, rows: RecordArray) -> Columns:
        """Take in one step; see `RoadFixedLag.step`.

        Returns:
            Columns of `road_smoothed.csv` with the rows that are final now, by track and time.
        """
        return columns_of_rows(self._lag.step(t, rows), self._share)

    def held(self) -> set[int]:
        """Return the identities of the tracks of which rows may still come."""
        return self._lag.held()

    def finish(self) -> Columns:
        """Return the rows that are not final yet, and forget the vehicles."""
        return columns_of_rows(self._lag.finish(), self._share)


def lagged_pieces(log: RecordArray, instants: FloatArray, table: RoadLagTable) -> Iterator[Columns]:
    """Rows of a whole recording, as they would have become final.

    Args:
        log: (M,) what the tracks took in, in order of time.
        instants: (I,) times of the steps, each of the log's among them.
        table: which has seen nothing yet.
    """
    first, last = (np.searchsorted(log["t"], instants, side=side) for side in ("left", "right"))
    for k, t in enumerate(instants.tolist()):
        yield table.step(t, log[first[k] : last[k]])
    yield table.finish()


class RoadFile:
    """A table of the road (CSV) that grows by whole lines while vehicles drive by; a context manager.

    A track has rows from when it has been reported: what never was has none.

    Args:
        path: the file, which is replaced; where it is moved away, a new one begins.
        table: gives the rows.
        over: of a pipe, tells whether the program is to end and its reader is not waited for any longer.

    Raises:
        DataError: it is a folder.
    """

    def __init__(self, path: str | Path, table: RoadLagTable, over: Callable[[], bool] = never) -> None:
        self._path, self._table, self._over = Path(path), table, over
        self._reported: set[int] = set()
        self._prune_at = _FEW
        if self._path.is_dir():
            raise DataError("is a folder; --road must name a file", path)

    def __enter__(self) -> Self:
        self._file = GrowingFile(self._path, over=self._over)
        self._file.begin((",".join(empty_road_columns()) + "\n").encode())
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            # After an error the vehicles may be in no state to be finished; being interrupted is none.
            if kind is None or not issubclass(kind, Exception) or issubclass(kind, JeatGraphError):
                self._append(self._table.finish())
        finally:
            self._file.close()

    def take(self, t: float, rows: RecordArray, reported: IntArray) -> None:
        """Take in a step, and hand the rows that are final to the system at once.

        Args:
            t: time of the step (s).
            rows: (M,) what it gave to the tracks.
            reported: (N,) the tracks in its table.
        """
        self._reported.update(reported.tolist())
        self._append(self._table.step(t, rows))
        if len(self._reported) > self._prune_at:  # those that have ended are not remembered for ever
            self._reported &= self._table.held().union(reported.tolist())
            self._prune_at = max(2 * len(self._reported), _FEW)

    def _append(self, columns: Columns) -> None:
        known = np.array([k in self._reported for k in columns["track_id"].tolist()], dtype=np.bool_)
        if known.any():
            self._file.follow()
            self._file.write(csv_lines({name: values[known] for name, values in columns.items()}).encode())
