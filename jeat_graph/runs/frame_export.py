"""Tables at the frame times of formats that count frames (MOTChallenge, KITTI)."""

from __future__ import annotations

import dataclasses

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.trajectories import Trajectories

MAX_AGE_S = 0.15  # as `eval` judges causal tables
_TOLERANCE_S = 1e-6


def causal_at_frames(
    table: Trajectories, instants: FloatArray, rate_hz: float, max_age_s: float = MAX_AGE_S
) -> Trajectories:
    """Predict the tracks of the latest instant before each frame to the frame, from nothing that came later.

    Args:
        table: a causal table, rows in time order.
        instants: (I,) all times at which the tracker ran, ascending (s).
        rate_hz: frames per second; frame k is at k / rate_hz.
        max_age_s: a frame further than this after the latest instant has no tracks.

    Returns:
        Rows at frame times, boxes moved by `v Δ + a Δ²/2`, variances those of the row predicted from.
    """
    if not len(instants):
        return table.take(np.zeros(0, dtype=np.int64))
    frames = np.arange(np.ceil(instants[0] * rate_hz), np.floor((instants[-1] + 0.5 / rate_hz) * rate_hz) + 1)
    times = frames / rate_hz
    latest = np.searchsorted(instants, times + _TOLERANCE_S, side="right") - 1
    alive = (latest >= 0) & (times - instants[np.maximum(latest, 0)] <= max_age_s)
    times, instant = times[alive], instants[latest[alive]]
    first = np.searchsorted(table.t, instant, side="left")
    count = np.searchsorted(table.t, instant, side="right") - first
    start = np.repeat(first - (np.cumsum(count) - count), count)
    rows = table.take(start + np.arange(len(start)))
    t = np.repeat(times, count)
    dt = (t - rows.t)[:, None]
    shift = rows.mean[:, 2:4] * dt + 0.5 * rows.mean[:, 4:6] * dt**2
    boxes, mean = rows.boxes.copy(), rows.mean.copy()
    boxes[:, :2] += shift
    mean[:, :2] += shift
    return dataclasses.replace(rows, t=t, boxes=boxes, mean=mean)


def smoothed_at_frames(table: Trajectories, instants: FloatArray, rate_hz: float) -> Trajectories:
    """Interpolate a smoothed table at the frame times, as `eval` does.

    Args:
        table: a smoothed table.
        instants: (I,) all times at which the tracker ran, ascending (s).
        rate_hz: frames per second; frame k is at k / rate_hz.

    Returns:
        Rows at frame times; existence that of the track's latest row, and no sensors.
    """
    from jeat_graph.eval.resampling import interpolate_to

    if not len(instants) or not len(table):
        return table.take(np.zeros(0, dtype=np.int64))
    frames = np.arange(np.ceil(instants[0] * rate_hz), np.floor((instants[-1] + 0.5 / rate_hz) * rate_hz) + 1)
    times = frames / rate_hz
    at = interpolate_to(table, times)
    order = np.lexsort((table.t, table.track_id))
    ids, first = np.unique(table.track_id[order], return_index=True)
    rank = np.searchsorted(ids, at.track_id)
    existence = np.empty(len(at.frame))
    for k, start in enumerate(first):
        rows = order[start : first[k + 1] if k + 1 < len(first) else None]
        mine = rank == k
        latest = np.searchsorted(table.t[rows], times[at.frame[mine]] + _TOLERANCE_S, side="right") - 1
        existence[mine] = table.existence[rows[np.maximum(latest, 0)]]
    return Trajectories(
        t=times[at.frame],
        track_id=at.track_id,
        boxes=at.boxes,
        existence=existence,
        mean=at.mean,
        var=at.var,
        used=np.zeros(len(at.frame), dtype=np.int64),
        sensors=table.sensors,
    )
