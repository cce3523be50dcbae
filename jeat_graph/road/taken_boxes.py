"""The detections that a run's tracks took in, as the road's least squares takes them.

A table holds estimates, whose errors hang together for a second and more. The detections behind them, each
with the noise with which the filter weighed it, say more, and say how sure they are.
"""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import BoolArray, RecordArray
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.road.box_rows import BoxConfig, rows_of_log
from jeat_graph.road.boxes_road import TrackBoxes, each_track
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.sway import steadied
from jeat_graph.tracking.identities.matching_rows import nearest

_SAME_TRACK = 0.5  # share of a fragment's detections that lie on a track for it to be a part of it
_FEW = 3  # fewer detections in a row that lie beside their track's boxes are errors, not another's


def boxes_of_log(
    log: RecordArray, table: Trajectories, camera: RoadCamera, config: BoxConfig
) -> list[TrackBoxes]:
    """Give each track of a table the detections that it took in.

    Where fragments were stitched the table has one identity for several of the log's, and where two vehicles
    were exchanged in hindsight each has what the other took in from then on. So detections of another
    identity belong to the track on whose boxes they lie, at times at which the track has none of its own.
    Where the table says which causal track each row is of, that counts first.
    """
    sensors = int(log["sensor"].max(initial=-1)) + 1
    log = _renamed(steadied(log), table)
    log = log[np.argsort(log["track_id"], kind="stable")]
    pieces = np.split(log, np.flatnonzero(np.diff(log["track_id"])) + 1) if len(log) else []
    tracks = {int(one.track_id[0]): one for one in each_track(table)}
    own: dict[int, list[RecordArray]] = {k: [] for k in tracks}
    strays: list[RecordArray] = []
    for rows in pieces:
        k = int(rows["track_id"][0])
        near, away = _split(rows, tracks[k]) if k in tracks else ([], [rows])
        own.get(k, []).extend(near)
        strays += away
    for rows in strays:
        k = int(rows["track_id"][0])
        owners = [other for other, one in tracks.items() if other != k and _belongs(rows, one, own[other])]
        # What lies on no other track is the track's own: a vehicle may stray from its smoothed boxes.
        for owner in owners or [k]:
            own.get(owner, []).append(rows)
    found = []
    for k, one in tracks.items():
        if own[k]:
            taken = np.concatenate(own[k])
            taken = taken[np.argsort(taken["t"], kind="stable")]
            boxes = rows_of_log(taken, sensors, (camera.width, camera.height), config)
            found.append(TrackBoxes(k, one.t, boxes))
    return found


def _renamed(log: RecordArray, table: Trajectories) -> RecordArray:
    """Return the log with the identities that the table has decided: of the row of its causal track then."""
    if table.causal_id is None or not len(table):
        return log
    order = np.lexsort((table.t, table.causal_id))
    causal, t, named = table.causal_id[order], table.t[order], table.track_id[order]
    out = log.copy()
    for k in np.unique(log["track_id"]).tolist():
        low, high = np.searchsorted(causal, [k, k + 1]).tolist()
        if high > low:
            own = log["track_id"] == k
            out["track_id"][own] = named[low + nearest(t[low:high], log["t"][own])]
    return out


def _split(rows: RecordArray, track: Trajectories) -> tuple[list[RecordArray], list[RecordArray]]:
    """Parts of a track's detections that lie on its boxes, and longer ones that do not."""
    on = _inside(rows, track)
    changes = np.flatnonzero(np.diff(on)) + 1
    parts = list(zip(np.split(rows, changes), np.split(on, changes), strict=True))
    away = [part for part, lies in parts if not lies[0] and len(part) >= _FEW]
    near = [part for part, lies in parts if lies[0] or len(part) < _FEW]
    return near, away


def _belongs(rows: RecordArray, track: Trajectories, parts: list[RecordArray]) -> bool:
    if rows["t"][-1] < track.t[0] or rows["t"][0] > track.t[-1]:
        return False
    if any(rows["t"][0] <= part["t"][-1] and part["t"][0] <= rows["t"][-1] for part in parts):
        return False
    return bool(_inside(rows, track).mean() >= _SAME_TRACK)


def _inside(rows: RecordArray, track: Trajectories) -> BoolArray:
    """Whether the middles of detections (M,) lie within a track's boxes at their times."""
    at = np.stack([np.interp(rows["t"], track.t, track.boxes[:, k]) for k in range(4)], axis=1)
    inside = np.abs(rows["z"] - at[:, :2] - at[:, 2:] / 2.0) < at[:, 2:] / 2.0
    return np.asarray(inside.all(axis=1))
