"""A run on the timelines of the viewer rerun: boxes and uncertainty of the tracks, and which sensor saw them.

Needs the extra `rerun`; the package is imported only here, and only when a run is logged.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.errors import DataError
from jeat_graph.data.extras import install
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.files.atomic import atomic_path

TIMELINE = "time"
_SPREAD = 2.0  # half axes of the drawn uncertainty, in standard deviations


def rerun_module() -> Any:
    """Import rerun.

    Raises:
        DataError: it is not installed; the message says how to get it.
    """
    try:
        import rerun
    except ImportError:
        raise DataError(f"the package rerun is missing: {install('rerun')}") from None
    return rerun


def log_run(tables: Mapping[str, Trajectories], name: str, path: str | Path | None = None) -> None:
    """Log the tables of a run, into a file or into a viewer that opens.

    Args:
        tables: by kind, `causal` and `smoothed`.
        name: what the viewer calls the run.
        path: a file `.rrd`; None to open the viewer.

    Raises:
        DataError: rerun is not installed, or has no viewer here.
    """
    rr = rerun_module()
    if path is None:
        stream = rr.RecordingStream("jeat-graph", recording_id=name)
        try:
            stream.spawn()
        except RuntimeError as error:  # its first line says what is missing, the others how to get it
            what = str(error).splitlines()[0]
            raise DataError(
                f"the viewer of rerun cannot be opened ({what}); `export --to rerun` writes a file for it"
            ) from None
        _log(rr, stream, tables)
        stream.flush()
        return
    with atomic_path(path) as temporary:
        # The name as identity: the same run is the same recording.
        stream = rr.RecordingStream("jeat-graph", recording_id=name)
        stream.save(temporary)
        _log(rr, stream, tables)
        stream.flush()
        stream.disconnect()


def _log(rr: Any, stream: Any, tables: Mapping[str, Trajectories]) -> None:
    for kind, table in tables.items():
        order = np.lexsort((table.track_id, table.t))
        starts = np.flatnonzero(np.diff(table.t[order], prepend=-np.inf))
        for rows in np.split(order, starts[1:]) if len(order) else []:
            _log_moment(rr, stream, kind, table.take(rows))
        for track_id in np.unique(table.track_id):
            _log_track(rr, stream, kind, table.of(int(track_id)))


def _log_moment(rr: Any, stream: Any, kind: str, now: Trajectories) -> None:
    """Boxes and uncertainty of all tracks of one moment."""
    stream.set_time(TIMELINE, duration=float(now.t[0]))
    ids = now.track_id.astype(np.uint16)
    texts = [f"{track} {seen}".strip() for track, seen in zip(now.track_id, now.sensor_text(), strict=True)]
    stream.log(
        f"picture/{kind}/boxes",
        rr.Boxes2D(mins=now.boxes[:, :2], sizes=now.boxes[:, 2:], class_ids=ids, labels=texts),
    )
    spread = _SPREAD * np.sqrt(np.maximum(now.var[:, :2], 0.0))
    stream.log(
        f"picture/{kind}/uncertainty", rr.Boxes2D(centers=now.center, half_sizes=spread, class_ids=ids)
    )
    stream.log(f"plots/{kind}/tracks", rr.Scalars(float(len(now))))


def _log_track(rr: Any, stream: Any, kind: str, track: Trajectories) -> None:
    """Speed and existence of one track over time."""
    order = np.argsort(track.t, kind="stable")
    times = rr.TimeColumn(TIMELINE, duration=track.t[order])
    name = f"plots/{kind}/track_{track.track_id[0]}"
    speed = np.hypot(*track.velocity[order].T)
    stream.send_columns(f"{name}/speed", indexes=[times], columns=rr.Scalars.columns(scalars=speed))
    existence = track.existence[order]
    stream.send_columns(f"{name}/existence", indexes=[times], columns=rr.Scalars.columns(scalars=existence))
