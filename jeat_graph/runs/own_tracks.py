"""The tracks that one sensor alone gives: what clocks and pictures of several sensors are compared by."""

from __future__ import annotations

import warnings

import numpy as np

from jeat_graph.config.reading import as_config, load_config
from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.rig.sensor_tracks import SensorTracks, sensor_tracks
from jeat_graph.runs.declaring import fit_input
from jeat_graph.tracking.tracker import Tracker


def own_tracks(detections: Detections, size_px: tuple[float, float] | None = None) -> SensorTracks:
    """Track one sensor alone, by the preset `default`, and put its smoothed tracks on a grid.

    Args:
        detections: of one sensor, in its own picture and on its own clock.
        size_px: width and height of its picture; by default as far as its boxes reach.
    """
    config = fit_input(as_config(load_config("default"), size_px), detections)[0]
    tracker = Tracker(config)
    parts: list[Trajectories] = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what is odd in the input the caller has told
        for k, _ in enumerate(tracker.run(detections)):
            if k % _STEPS_PER_DRAIN == 0:
                parts.append(tracker.drain_smoothed())
        parts.append(tracker.finish())
    table = Trajectories.concatenate(parts)
    whole = _whole(table.boxes, (config.image.width, config.image.height))
    return sensor_tracks(table.t[whole], table.track_id[whole], table.boxes[whole], detections)


def _whole(boxes: FloatArray, size_px: tuple[float, float]) -> BoolArray:
    """Which boxes (N, 4) the picture's edge does not cut: of others neither size nor centre is seen."""
    margin = _MARGIN * boxes[:, 2:]
    far = boxes[:, :2] + boxes[:, 2:]
    return np.asarray((boxes[:, :2] > margin).all(axis=1) & (far < np.array(size_px) - margin).all(axis=1))


_STEPS_PER_DRAIN = 256
# The edge may cut boxes that end nearer to it than this share of their size: two standard deviations of usual
# detectors.
_MARGIN = 0.1
