"""The tracks that one sensor alone gives: what clocks and pictures of several sensors are compared by."""

from __future__ import annotations

import warnings
from collections.abc import Generator

from jeat_graph.config.reading import as_config, load_config
from jeat_graph.data.detections import Detections
from jeat_graph.data.in_steps import run_through, worth
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.rig.sensor_tracks import SensorTracks, sensor_tracks_in_steps
from jeat_graph.runs.declaring import fit_input
from jeat_graph.tracking.tracker import Tracker

_SCANS_PER_DRAIN, _DRAINING_STEPS = 256, 8


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
            warnings.simplefilter("ignore")  # of what is odd in the input the caller has told
            tracker.step(batch)
        if k % _SCANS_PER_DRAIN == 0:
            parts.append(tracker.drain_smoothed())
            yield from worth(_DRAINING_STEPS)
        yield
    parts.append(tracker.finish())
    table = Trajectories.concatenate(parts)
    yield from worth(_DRAINING_STEPS)
    return (yield from sensor_tracks_in_steps(table.t, table.track_id, table.boxes, detections))
