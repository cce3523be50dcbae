"""What is measured in a process of its own.

`python -m tests.performance.jobs NAME [ARGUMENT]` prints what it found as JSON.
"""

import gc
import json
import sys
import time

import numpy as np

from benchmarks.speed_worker import resident_mib
from jeat_graph import Tracker, load_config
from jeat_graph.smoothers.filtered_track import FilteredTrack
from jeat_graph.smoothers.gtsam.solvers import LagChain
from tests.tracking.endless import scans_100_hz

#: The tracker whose smoother is GTSAM's with a fixed lag.
LAGGED = load_config("paper", ["smoother.engine=gtsam"])


def live(preset):
    """Memory of a tracker that is stepped for minutes (MiB, one reading per 35 s)."""
    tracker, memory = Tracker(load_config(preset, ["smoother.engine=none"])), []
    for k, scan in enumerate(scans_100_hz(17_500)):
        tracker.step(scan)
        if k % 3_500 == 3_499:
            gc.collect()
            memory.append(resident_mib())
    return {"memory": memory, "born": tracker.num_born}


class OneVehicle:
    """A tracker with its smoother, and one vehicle that stays in the picture."""

    def __init__(self):
        self.tracker, self.steps, self._rng = Tracker(LAGGED), 0, np.random.default_rng(0)

    def drive(self):
        """Take the next 4.8 s; returns their processor time (s)."""
        began = time.process_time()
        for k in range(self.steps, self.steps + 480):
            t = 0.01 * k
            x, y = 640.0 + 400.0 * np.sin(0.3 * t), 360.0 + 200.0 * np.cos(0.2 * t)
            noise = self._rng.normal(0.0, [[1.5, 1.5, 0.5, 0.5]])
            box = np.array([[x - 30.0, y - 20.0, 60.0, 40.0]]) + noise
            self.tracker.step((t, "rgb" if k % 5 == 0 else "evt", box, [0.95]))
        self.steps += 480
        self.tracker.drain_smoothed()
        return time.process_time() - began


def long_track():
    """Memory (MiB) of one vehicle that stays for minutes, with its smoother.

    And least processor time (s) of a piece of it, of one that came lately and of one of long ago, in turns.
    """
    old, memory = OneVehicle(), []
    for _ in range(38):
        old.drive()
        memory.append(resident_mib())
    young = OneVehicle()
    for _ in range(5):
        young.drive()
    early, late = (
        min(spent) for spent in zip(*((young.drive(), old.drive()) for _ in range(10)), strict=True)
    )
    born = old.tracker.num_born
    old.tracker.finish()
    return {"memory": memory, "early": early, "late": late, "born": born, **old.tracker.smoother_counts}


def short_tracks():
    """Memory (MiB) while 150 vehicles come and go one after the other, with their smoothers."""
    tracker, rng, t, memory = Tracker(LAGGED), np.random.default_rng(1), 0.0, []
    for track in range(150):
        x, y = rng.uniform(200.0, 1000.0), rng.uniform(100.0, 600.0)
        for k in range(40):
            t += 0.01
            box = np.array([[x + k - 30.0, y - 20.0, 60.0, 40.0]]) + rng.normal(0.0, 1.0, (1, 4))
            tracker.step((t, "rgb" if k % 5 == 0 else "evt", box, [0.95]))
        for sensor in ["rgb", "evt"] * 20:
            t += 0.05
            tracker.step((t, sensor, np.zeros((0, 4)), np.zeros(0)))
        if track % 10 == 9:
            tracker.drain_smoothed()
            gc.collect()
            memory.append(resident_mib())
    left = len(tracker._model._histories._solver._chains)
    return {"memory": memory, "left": left, **tracker.smoother_counts}


def short_windows():
    """Memory (MiB) while windows of a few states are filled and forgotten, one reading per 50 lives."""
    rng, memory, F = np.random.default_rng(0), [], np.broadcast_to(np.eye(3), (7, 2, 3, 3))
    wide, narrow = (
        np.broadcast_to(part * np.diag([9.0, 2500.0, 900.0]), (7, 2, 3, 3)) for part in (2.0, 1.0)
    )
    for life in range(250):
        chain, mean = LagChain(), rng.normal(size=(7, 2, 3))
        whole = FilteredTrack(life, np.arange(7.0), F, mean, wide, mean, narrow, np.zeros(7, dtype=np.int64))
        for number in range(6):
            here = slice(number, number + 2)
            states = (one[here] for one in (whole.t, F, mean, wide, mean, narrow, whole.sensor))
            chain.extend(FilteredTrack(life, *states))
            chain.states(1)
            chain.leave(1)
        if life % 50 == 49:
            gc.collect()
            memory.append(resident_mib())
    return {"memory": memory}


if __name__ == "__main__":
    name, *rest = sys.argv[1:]
    print(json.dumps(globals()[name](*rest)))
