"""Write one track as a trajectory file of the TUM format, which trajectory tools such as evo read.

One pose a line: `timestamp tx ty tz qx qy qz qw`. Positions are those of the box centre in the picture (px)
with z = 0, and the orientation is the direction of motion in the picture, a rotation about z.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.exporting.record import ExportRequest, ExportTarget
from jeat_graph.exporting.sources import run_tables, summary_of
from jeat_graph.io.files.atomic import open_atomic


def write_tum(table: Trajectories, track_id: int, path: str | Path) -> None:
    """Write the rows of one track, in order of time.

    Args:
        table: the tracks.
        track_id: which of them.
        path: the file, text.

    Raises:
        DataError: there is no such track.
    """
    rows = table.take(table.track_id == track_id)
    if not len(rows):
        raise DataError(f"there is no track {track_id}")
    rows = rows.take(np.argsort(rows.t, kind="stable"))
    half = 0.5 * np.arctan2(rows.mean[:, 3], rows.mean[:, 2])
    nothing = np.zeros(len(rows))
    poses = np.column_stack(
        [rows.t, rows.mean[:, 0], rows.mean[:, 1], nothing, nothing, nothing, np.sin(half), np.cos(half)]
    )
    with open_atomic(path) as file:
        for pose in poses:
            file.write(
                " ".join(f"{value:.9g}" if k else f"{value:.9f}" for k, value in enumerate(pose)) + "\n"
            )


def _write(request: ExportRequest) -> str:
    tables = run_tables(request)
    if request.track is None:
        raise DataError("--to tum writes one trajectory: say which with --track ID")
    write_tum(next(iter(tables.values())), request.track, request.out)
    return summary_of(tables)


EXPORT = ExportTarget(
    name="tum",
    program="evo and other tools for single trajectories",
    writes="`.txt`: the poses of one track",
    write=_write,
    options=("only", "track"),
)
