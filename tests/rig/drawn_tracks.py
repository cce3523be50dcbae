"""Tracks of one sensor as they are on the grid of its clock, drawn without any detections."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.rig.sensor_tracks import SensorTracks, TrackMeasurements


def moving_tracks(start_s: float, centre: FloatArray, size: FloatArray) -> SensorTracks:
    """Tracks that all move, with middles (N, T, 2) and width and height (N, T, 2); NaN where they are not."""
    none = TrackMeasurements(np.zeros(0), np.zeros((0, 2)), np.zeros((0, 2)))
    return SensorTracks(start_s, centre, size, [none] * len(centre), np.ones(len(centre)))
