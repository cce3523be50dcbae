"""One long track, and many short ones: memory and time per measurement stay what they are."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np

# In a process of its own: what other tests leave behind in this one would blur the memory.
COMMON = """
import json, time
import numpy as np
from jeat_graph import Tracker, load_config
from jeat_graph.benchmark.speed_worker import resident_mib

tracker = Tracker(load_config("default"))
memory, spent = [], []
"""
LONG = """
rng = np.random.default_rng(0)
for k in range(24_000):
    if k % 6_000 == 0:
        memory.append(resident_mib())
        spent.append(time.process_time())
    t = 0.01 * k
    x, y = 640.0 + 400.0 * np.sin(0.3 * t), 360.0 + 200.0 * np.cos(0.2 * t)
    box = np.array([[x - 30.0, y - 20.0, 60.0, 40.0]]) + rng.normal(0.0, [[1.5, 1.5, 0.5, 0.5]])
    tracker.step((t, "rgb" if k % 5 == 0 else "evt", box, [0.95]))
    if k % 480 == 479:
        tracker.drain_smoothed()
memory.append(resident_mib())
spent.append(time.process_time())
born = tracker.num_born
tracker.finish()
print(json.dumps({"memory": memory, "spent": spent, "born": born, **tracker.smoother_counts}))
"""
SHORT = """
rng, t = np.random.default_rng(1), 0.0
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
left = len(tracker._smoothers._smoothers._histories)
print(json.dumps({"memory": memory, "left": left, **tracker.smoother_counts}))
"""


def outcome(script):
    """What a script prints, run in a process of its own."""
    run = subprocess.run([sys.executable, "-c", COMMON + script], capture_output=True, text=True, check=True)
    return json.loads(run.stdout)


def test_a_long_track_costs_no_more_at_its_end():
    found = outcome(LONG)
    assert found["born"] == 1
    assert found["rebuilds"] == found["fallbacks"] == 0
    assert found["memory"][-1] - found["memory"][1] < 4.0
    first, *rest = np.diff(found["spent"])[1:]
    assert max(rest) < 1.6 * first


def test_many_short_tracks_leave_nothing_behind():
    found = outcome(SHORT)
    assert found["tracks"] == 150
    assert found["left"] == 0
    assert found["memory"][-1] - found["memory"][4] < 4.0
