"""The compiled code is loaded before the first scan of a live run arrives, which should not wait for it."""

from __future__ import annotations

from dataclasses import replace

from jeat_graph.config.schema import Config
from jeat_graph.tracking.notice import notice_if_cold
from jeat_graph.tracking.tracker import Tracker

_WARM_STEPS = 20  # enough for a track to be confirmed and smoothed
_STEP_S = 0.05


def warm_up(config: Config) -> None:
    """Track a vehicle that is not there."""
    notice_if_cold()
    spare = Tracker(replace(config, smoother=replace(config.smoother, worker=False)))
    box = [0.4 * config.image.width, 0.4 * config.image.height, 40.0, 30.0]
    for k in range(_WARM_STEPS):
        spare.step([(_STEP_S * k, name, [box], [0.9]) for name in spare.sensor_names])
    spare.finish()
