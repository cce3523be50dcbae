"""Recordings small enough to track in a moment."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph import Tracker, load_config
from jeat_graph.data.detections import Detections, Scan

RGB_HZ, EVT_HZ = 20.0, 100.0


def car(t, start=(200.0, 300.0), velocity=(120.0, 20.0)):
    """Box of a car that moves evenly."""
    x, y = start[0] + velocity[0] * t, start[1] + velocity[1] * t
    return [x - 30.0, y - 20.0, 60.0, 40.0]


def recording(duration=3.0, cars=((0.0, 99.0, {}),), blind=(), seed=0, noise=1.5):
    """Scans of both sensors: `cars` are (from, until, motion), `blind` spans in which nothing is found."""
    rng = np.random.default_rng(seed)
    scans = []
    for sensor, rate in (("rgb", RGB_HZ), ("evt", EVT_HZ)):
        for k in range(int(duration * rate)):
            t = k / rate
            boxes = [
                car(t, **motion)
                for start, end, motion in cars
                if start <= t < end and not any(a <= t < b for a, b in blind)
            ]
            if boxes:
                found = np.array(boxes) + rng.normal(0.0, [noise, noise, 1.0, 1.0], (len(boxes), 4))
            else:
                found = np.zeros((0, 4))
            scans.append(Scan(t, sensor, found, np.full(len(found), 0.95)))
    return Detections.from_scans(scans)


def make_tracker(*overrides):
    return Tracker(load_config("highway", overrides))


def run(tracker, detections):
    """Causal table of a whole recording."""
    from jeat_graph.data.trajectories import Trajectories

    return Trajectories.concatenate(list(tracker.run(detections)))


@pytest.fixture(scope="session")
def one_car():
    return recording()
