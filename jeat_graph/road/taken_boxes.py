"""The detections that a run's tracks took in, as the road's least squares takes them.

A table holds estimates, whose errors hang together for a second and more. The detections behind them, each
with the noise with which the filter weighed it, say more, and say how sure they are.
"""

from __future__ import annotations

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import RecordArray
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.road.box_rows import BoxConfig, SensorErrors, rows_of_log
from jeat_graph.road.boxes_road import TrackBoxes, each_track
from jeat_graph.road.camera import RoadCamera

_SAME_TRACK = 0.5  # share of a fragment's detections that lie on a track for it to be a part of it


def sensor_errors(config: Config) -> SensorErrors:
    """Memory of the sensors' errors as a configuration has it, in the tracker's order of sensors."""
    sensors = [config.sensors[name] for name in config.sensor_names]
    return SensorErrors(
        np.array([one.memory_s for one in sensors]), np.array([one.correlated_share for one in sensors])
    )


def boxes_of_log(
    log: RecordArray, errors: SensorErrors, table: Trajectories, camera: RoadCamera, config: BoxConfig
) -> list[TrackBoxes]:
    """Give each track of a table the detections that it took in.

    Where fragments were stitched the table has one identity for several of the log's: a fragment belongs to
    the track on whose boxes its detections lie, at times at which the track has none of its own.
    """
    log = log[np.argsort(log["track_id"], kind="stable")]
    pieces = np.split(log, np.flatnonzero(np.diff(log["track_id"])) + 1) if len(log) else []
    own = {int(rows["track_id"][0]): rows for rows in pieces}
    tracks = each_track(table)
    known = {int(one.track_id[0]) for one in tracks}
    strays = [rows for k, rows in own.items() if k not in known]
    found = []
    for one in tracks:
        k = int(one.track_id[0])
        parts = [own[k]] if k in own else []
        parts += [rows for rows in strays if _belongs(rows, one, parts)]
        if not parts:
            continue
        taken = np.concatenate(parts)
        taken = taken[np.argsort(taken["t"], kind="stable")]
        rows = rows_of_log(taken, errors, (camera.width, camera.height), config)
        found.append(TrackBoxes(k, one.t, rows))
    return found


def _belongs(rows: RecordArray, track: Trajectories, parts: list[RecordArray]) -> bool:
    if rows["t"][-1] < track.t[0] or rows["t"][0] > track.t[-1]:
        return False
    if any(rows["t"][0] <= part["t"][-1] and part["t"][0] <= rows["t"][-1] for part in parts):
        return False
    at = np.stack([np.interp(rows["t"], track.t, track.boxes[:, k]) for k in range(4)], axis=1)
    inside = np.abs(rows["z"] - at[:, :2] - at[:, 2:] / 2.0) < at[:, 2:] / 2.0
    return bool(inside.all(axis=1).mean() >= _SAME_TRACK)
