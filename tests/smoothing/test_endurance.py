"""One long track, and many short ones: memory and time per measurement stay what they are."""

from __future__ import annotations

import time

import numpy as np

from jeat_graph.benchmark.speed_worker import resident_mib

from .conftest import make_tracker


def scan(rng, k):
    """A vehicle on a long closed course, seen 100 times a second; every fifth scan is the other sensor's."""
    t = 0.01 * k
    x, y = 640.0 + 400.0 * np.sin(0.3 * t), 360.0 + 200.0 * np.cos(0.2 * t)
    box = np.array([[x - 30.0, y - 20.0, 60.0, 40.0]]) + rng.normal(0.0, [[1.5, 1.5, 0.5, 0.5]])
    return t, "rgb" if k % 5 == 0 else "evt", box, [0.95]


def test_a_long_track_costs_no_more_at_its_end():
    rng, tracker = np.random.default_rng(0), make_tracker()
    spent, memory = [], []
    for k in range(24_000):
        if k % 6_000 == 0:
            memory.append(resident_mib())
            spent.append(time.process_time())
        tracker.step(scan(rng, k))
        if k % 480 == 479:
            tracker.drain_smoothed()
    spent.append(time.process_time())
    tracker.finish()
    assert tracker.num_born == 1
    assert tracker.smoother_counts["rebuilds"] == tracker.smoother_counts["fallbacks"] == 0
    assert resident_mib() - memory[1] < 4.0
    first, *rest = np.diff(spent)[1:]
    assert max(rest) < 1.6 * first


def test_many_short_tracks_leave_nothing_behind():
    rng, tracker = np.random.default_rng(1), make_tracker()
    memory, t = [], 0.0
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
            memory.append(resident_mib())
    assert tracker.smoother_counts["tracks"] == 150
    assert memory[-1] - memory[4] < 4.0
    assert not tracker._smoothers._smoothers._histories
