"""A picture mirrored gives the same tracks, mirrored: no side of the picture is another than its opposite.

But for one thing, which is a model of the road: where boxes overlap the lower one is the nearer, as on a
road that is seen from above (`association.boxes.occluded_fraction`). So vehicles that overlap are mirrored
from left to right only.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from jeat_graph import Detections, track

IMAGE = (1280.0, 720.0)
RATE_HZ, DURATION_S = 20.0, 8.0
# Places that halves of a px do not round: what is mirrored is then the same to the last bit.
GRID = 64.0


def street(seed: int, apart_px: float = 130.0) -> Detections:
    """Vehicles in lanes, each with its own speed, boxes with noise, misses and a false box now and then."""
    rng = np.random.default_rng(seed)
    rows = []
    lanes = [(60.0 + apart_px * k, speed) for k, speed in enumerate((180.0, -150.0, 90.0, -240.0, 40.0))]
    for t in np.arange(0.0, DURATION_S, 1.0 / RATE_HZ):
        rows.append((t, *[np.nan] * 5))
        for top, speed in lanes:
            for k in range(3):
                left = (430.0 * k + speed * t) % 1290.0 - 5.0
                if rng.random() < 0.92 and 2.0 < left < 1190.0:
                    box = np.array([left, top, 80.0, 50.0]) + 1.5 * rng.standard_normal(4)
                    rows.append((t, *np.round(box * GRID) / GRID, rng.uniform(0.5, 0.95)))
        if rng.random() < 0.1:
            rows.append((t, *np.round(rng.uniform(200.0, 500.0, 2)), 30.0, 14.0, 0.3))
    d = np.array(rows)
    return Detections.from_rows(d[:, 0], ["cam"] * len(d), d[:, 1:5], d[:, 5], np.isnan(d[:, 1]))


def mirrored(boxes: np.ndarray, axis: int) -> np.ndarray:
    out = boxes.copy()
    out[:, axis] = IMAGE[axis] - boxes[:, axis] - boxes[:, 2 + axis]
    return out


@pytest.mark.parametrize(
    ("seed", "axis", "apart_px"), [(0, 0, 130.0), (1, 0, 130.0), (0, 1, 130.0), (1, 1, 130.0), (0, 0, 30.0)]
)
def test_the_tracks_of_a_mirrored_picture_are_mirrored(seed, axis, apart_px):
    seen = street(seed, apart_px)  # boxes are 50 px high: lanes 30 px apart hide each other's vehicles
    plain = track(seen, image=IMAGE)
    other = track(replace(seen, boxes=mirrored(seen.boxes, axis)), image=IMAGE)
    for kind in ("causal", "smoothed"):
        one, two = getattr(plain, kind), getattr(other, kind)
        assert len(one) > 1000
        np.testing.assert_array_equal(one.track_id, two.track_id)
        np.testing.assert_allclose(one.boxes, mirrored(two.boxes, axis), atol=1e-3)
        np.testing.assert_allclose(one.existence, two.existence, atol=1e-6)
