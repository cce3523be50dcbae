"""Print a digest of what the core makes of some drawn streams: every bit of its tables and of its state.

`.ci/marches` runs it with cores that were built for different processors.
"""

from __future__ import annotations

import hashlib

import numpy as np

from jeat_graph import Tracker, load_config

SEEDS, STEPS = 6, 150


def digest() -> str:
    """Track drawn vehicles with two sensors, clutter and misses, and hash all that comes out."""
    found = hashlib.sha256()
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        tracker = Tracker(load_config("default"), image=(1280, 720))
        start, velocity = rng.uniform((0.0, 0.0), (1200.0, 650.0), (8, 2)), rng.uniform(-80.0, 80.0, (8, 2))
        size = rng.uniform(20.0, 90.0, (8, 2))
        for k in range(STEPS):
            t = 0.05 * k
            for sensor, late in (("a", 0.0), ("b", 0.01)):
                seen = rng.random(8) < 0.85
                centre = start + velocity * (t + late) + rng.uniform(-2.0, 2.0, (8, 2))
                boxes = np.concatenate([centre - size / 2, size], axis=1)[seen]
                false = np.column_stack([rng.uniform(0.0, 600.0, (2, 2)), rng.uniform(10.0, 60.0, (2, 2))])
                scores = np.concatenate([rng.uniform(0.4, 0.95, int(seen.sum())), rng.uniform(0.1, 0.5, 2)])
                table = tracker.step((t + late, sensor, np.concatenate([boxes, false]), scores))
                for column in (table.track_id, table.boxes, table.existence, table.mean, table.var):
                    found.update(np.ascontiguousarray(column).tobytes())
        smoothed = tracker.finish()
        for column in (smoothed.t, smoothed.track_id, smoothed.boxes, smoothed.existence, smoothed.var):
            found.update(np.ascontiguousarray(column).tobytes())
    return found.hexdigest()


if __name__ == "__main__":
    print(digest())
