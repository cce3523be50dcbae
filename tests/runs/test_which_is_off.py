"""Of two detectors of one road one lies off: which one, nobody says."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph import Detections, GroundTruth, Scan, evaluate, track

from .road import IMAGE, LANES, truth_of

SECONDS, RATE_HZ = 30.0, 10.0


def drawn_road(off: float, seed: int) -> tuple[Detections, GroundTruth]:
    """Vehicles of all aspects; one sensor jitters, the boxes of the other repeat and are `off` (sizes)."""
    rng = np.random.default_rng(seed)
    vehicles, scans, truth = [], [], []
    for top, speed in LANES:
        t = rng.uniform(0.0, 2.0)
        while t < SECONDS:
            width = rng.uniform(80.0, 130.0)
            height = 0.6 * width * np.exp(rng.normal(0.0, 0.25))
            vehicles.append((t, top, width, height, speed, rng.normal(0.0, off, 4)))
            t += rng.uniform(1.0, 2.5)
    for t in np.arange(0.0, SECONDS, 1.0 / RATE_HZ):
        jittering, lying = [], []
        for k, (begin, top, width, height, speed, error) in enumerate(vehicles):
            left = speed * (t - begin) - width if speed > 0 else IMAGE[0] + speed * (t - begin)
            if t < begin or left < 0.0 or left + width > IMAGE[0]:
                continue
            box = np.array([left, top, width, height])
            truth.append((t, k, *box))
            if rng.random() < 0.9:
                jittering.append(box + rng.normal(0.0, 3.0, 4))
            if rng.random() < 0.95:
                moved = error + rng.normal(0.0, 0.01, 4)
                size = box[2:] * np.exp(moved[2:])
                centre = box[:2] + box[2:] * (0.5 + moved[:2])
                lying.append(np.concatenate([centre - size / 2.0, size]))
        for name, boxes in (("right", jittering), ("wrong", lying)):
            scores = rng.uniform(0.5, 0.95, len(boxes))
            scans.append(Scan(float(t), name, np.array(boxes).reshape(-1, 4), scores))
    return Detections.from_scans(scans), truth_of(truth, np.unique([row[0] for row in truth]))


@pytest.mark.parametrize("seed", range(3))
def test_the_sensor_that_is_off_does_not_spoil_the_tracks(seed):
    """Though it repeats to the pixel and finds more."""
    detections, truth = drawn_road(0.2, seed)
    joined = evaluate(track(detections, image=IMAGE), truth)["causal"]
    alone = evaluate(track(detections.select(["right"]), image=IMAGE), truth)["causal"]
    assert joined["MOTA"] > alone["MOTA"] - 3.0
    assert joined["HOTA"] > 70.0
