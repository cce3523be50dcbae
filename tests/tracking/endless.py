"""Traffic that goes on for as long as is asked."""

import numpy as np


def scans_100_hz(num, seed=0):
    """Endless traffic: three vehicles that start again every 3 s, clutter, and empty scans."""
    rng = np.random.default_rng(seed)
    size = np.array([40.0, 30.0])
    clutter = np.hstack([rng.uniform([0, 0], [1200, 650], (997, 2)), rng.uniform(10, 60, (997, 2))])
    noise = rng.normal(0, 1.0, (1009, 3, 2))
    scores = np.full(4, 0.9)
    for k in range(num):
        t = 0.01 * k
        age = t % 3.0
        centre = np.array([[100 + 300 * age, 200], [1100 - 300 * age, 400], [300 + 100 * age, 600]])
        boxes = np.empty((4, 4))
        boxes[:3, :2] = centre + noise[k % 1009] - size / 2
        boxes[:3, 2:] = size
        boxes[3] = clutter[k % 997]
        shown = 0 if k % 10 == 7 else 4 if k % 5 == 0 else 3
        yield (t, "evt" if k % 6 else "rgb", boxes[:shown], scores[:shown])
