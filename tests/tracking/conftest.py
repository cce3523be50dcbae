"""What the tracker's tests share: a look at the state of all tracks, and scenes."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest


@pytest.fixture(scope="session")
def oracle():
    """The plain reading of the paper's algorithm."""
    spec = importlib.util.spec_from_file_location("paper_oracle", Path(__file__).parent / "paper_oracle.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def make_scene(seed, duration=2.0, vehicles=6, rgb_hz=20.0, evt_hz=100.0, jitter=0.0, clutter=0.5, miss=0.15):
    """Batches [(t, [(sensor, boxes, scores), …]), …] of vehicles in the picture, with clutter and misses."""
    rng = np.random.default_rng(seed)
    start, velocity = rng.uniform([0, 0], [1280, 720], (vehicles, 2)), rng.normal(0, 150, (vehicles, 2))
    sizes = rng.uniform(20, 80, (vehicles, 2))
    scans = []
    for sensor, rate, noise in (("rgb", rgb_hz, 2.0), ("evt", evt_hz, 3.0)):
        for k in range(int(duration * rate)):
            t = round(k / rate, 6) + (rng.uniform(0, jitter) if jitter else 0.0)
            if rng.random() < 0.03:
                continue  # the scan was dropped
            centre = start + velocity * t
            seen = rng.random(vehicles) > miss
            extra = rng.poisson(clutter)
            centre = np.vstack([centre[seen], rng.uniform([0, 0], [1280, 720], (extra, 2))])
            size = np.vstack([sizes[seen], rng.uniform(20, 80, (extra, 2))])
            centre = centre + rng.normal(0, noise, centre.shape)
            scans.append((t, sensor, np.hstack([centre - size / 2, size]), rng.uniform(0.02, 1, len(centre))))
    batches = {}
    for t, sensor, boxes, scores in sorted(scans, key=lambda scan: (scan[0], scan[1])):
        batches.setdefault(t, []).append((sensor, boxes, scores))
    return list(batches.items())


@pytest.fixture(scope="session")
def scene():
    """See `make_scene`."""
    return make_scene
