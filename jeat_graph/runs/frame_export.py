"""Tables at the frame times of formats that count frames (MOTChallenge, KITTI)."""

from __future__ import annotations

import dataclasses

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.steps import check_steps
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.eval.frames import Kind
from jeat_graph.eval.resampling import TIME_TOLERANCE_S, interpolate_to, predict_to


def at_frames(table: Trajectories, kind: Kind, instants: FloatArray, rate_hz: float) -> Trajectories:
    """Resample a table to frame times, exactly as `eval` would judge it there.

    Args:
        table: a causal or smoothed table.
        kind: `causal` estimates are predicted from the latest instant before a frame, from nothing that came
            later; `smoothed` ones are interpolated.
        instants: (I,) all times at which the tracker ran, ascending (s).
        rate_hz: frames per second; frame k is at k / rate_hz.

    Returns:
        Rows at frame times; existence that of the track's latest row.

    Raises:
        DataError: the instants reach over too many frames, as where one of them is wrong.
    """
    if not len(instants) or not len(table):
        return table.take(np.zeros(0, dtype=np.int64))
    check_steps(float(instants[0]), float(instants[-1]), rate_hz, "frames")
    # A frame's time times the rate may come out above its number by a rounding.
    first = np.ceil((instants[0] - TIME_TOLERANCE_S) * rate_hz)
    last = np.floor((instants[-1] + 0.5 / rate_hz) * rate_hz)
    times = np.arange(first, last + 1) / rate_hz
    resample = predict_to if kind == "causal" else interpolate_to
    at = resample(table, times, instants=instants)
    return dataclasses.replace(
        table.take(at.row), t=times[at.frame], boxes=at.boxes, mean=at.mean, var=at.var
    )
