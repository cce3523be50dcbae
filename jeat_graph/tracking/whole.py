"""A whole recording at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.detections import Detections
from jeat_graph.data.progress import with_progress
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.tracker import Tracker


def both_tables(config: Config, detections: Detections) -> tuple[Trajectories, Trajectories]:
    """Track a recording and return its causal table and the smoothed one, of whole tracks.

    Args:
        config: sensors and settings.
        detections: the recording.
    """
    tracker = Tracker(replace(config, smoother=replace(config.smoother, engine="full")))
    causal = list(tracker.run(detections))
    smoothed = tracker.finish()
    return Trajectories.concatenate(causal or [Trajectories.empty(tracker.sensor_names)]), smoothed


def track(config: Config, detections: Detections) -> Trajectories:
    """Track a recording from beginning to end and return the whole causal table.

    Args:
        config: sensors and settings.
        detections: the recording.
    """
    causal_only = replace(config, smoother=replace(config.smoother, engine="none"))
    steps = with_progress(Tracker(causal_only).run(detections), len(np.unique(detections.scan_t)))
    return Trajectories.concatenate(list(steps) or [Trajectories.empty()])
