"""The tracks that one sensor alone gives: what clocks and pictures of several sensors are compared by."""

from __future__ import annotations

import warnings
from collections.abc import Generator

import numpy as np

from jeat_graph.config.reading import as_config, load_config
from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.in_steps import run_through, worth
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.rig.sensor_tracks import SensorTracks, sensor_tracks_in_steps
from jeat_graph.runs.declaring import fit_input
from jeat_graph.tracking.tracker import Tracker

_SCANS_PER_DRAIN, _DRAINING_STEPS = 256, 8
# The edge may cut boxes that end nearer to it than this share of their size: two standard deviations of usual
# detectors.
_MARGIN = 0.1


def own_tracks(detections: Detections, size_px: tuple[float, float] | None = None) -> SensorTracks:
    """Track one sensor alone, by the preset `default`, and put its smoothed tracks on a grid.

    Args:
        detections: of one sensor, in its own picture and on its own clock.
        size_px: width and height of its picture; by default as far as its boxes reach.
    """
    return run_through(own_tracks_in_steps(detections, size_px))


def own_tracks_in_steps(
    detections: Detections, size_px: tuple[float, float] | None = None
) -> Generator[None, None, SensorTracks]:
    """Do what `own_tracks` does, one scan or a part of one track a step."""
    config = fit_input(as_config(load_config("default"), size_px), detections)[0]
    tracker = Tracker(config)
    parts: list[Trajectories] = []
    yield
    for k, batch in enumerate(detections.batches()):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of what is odd in the input the caller has reported already
            tracker.step(batch)
        if k % _SCANS_PER_DRAIN == 0:
            parts.append(tracker.drain_smoothed())
            yield from worth(_DRAINING_STEPS)
        yield
    parts.append(tracker.finish())
    table = Trajectories.concatenate(parts)
    yield from worth(_DRAINING_STEPS)
    whole = _whole(table.boxes, (config.image.width, config.image.height))
    rows = table.t[whole], table.track_id[whole], table.boxes[whole]
    return (yield from sensor_tracks_in_steps(*rows, detections))


def _whole(boxes: FloatArray, size_px: tuple[float, float]) -> BoolArray:
    """Which boxes (N, 4) the picture's edge does not cut: of others neither size nor centre is seen."""
    margin = _MARGIN * boxes[:, 2:]
    far = boxes[:, :2] + boxes[:, 2:]
    return np.asarray((boxes[:, :2] > margin).all(axis=1) & (far < np.array(size_px) - margin).all(axis=1))
