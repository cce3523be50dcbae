"""Rates of the sensors in recordings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jeat_graph.data.detections import Detections


def scan_rate(recordings: Sequence[Detections], sensor: str) -> float:
    """Rate of a sensor's scans (Hz), from the median step; 20 where there are less than two scans."""
    steps = [
        np.diff(d.scan_t[d.scan_sensor == d.sensors.index(sensor)]) for d in recordings if sensor in d.sensors
    ]
    every = np.concatenate(steps)
    return float(1.0 / np.median(every)) if len(every) else 20.0
