"""A whole recording at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.detections import Detections
from jeat_graph.data.progress import told
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.tracker import Tracker


def track(config: Config, detections: Detections) -> Trajectories:
    """Track a recording from beginning to end and return the whole causal table.

    Args:
        config: sensors and settings.
        detections: the recording.
    """
    causal_only = replace(config, smoother=replace(config.smoother, engine="none"))
    steps = told(Tracker(causal_only).run(detections), len(np.unique(detections.scan_t)))
    return Trajectories.concatenate(list(steps) or [Trajectories.empty()])
