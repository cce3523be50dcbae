"""What sensors see is tracked, whatever pair of sensors it is: any rates, boxes, clocks and clutter."""

from __future__ import annotations

import numpy as np

from jeat_graph.core import tracking as compiled
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.filters.score_calibration import logit

PICTURE = np.array([1920.0, 1080.0])
SECONDS = 12.0
#: Pairs of which one sensor alone sees every object some times a second, and the others.
CONSISTENT, POOR = 0.9, 0.5


def drawn_pair(rng):
    """Two sensors; the second one's boxes are half to twice the size, and up to .1 s old."""
    pair = []
    for s in range(2):
        pair.append(
            {
                "rate": np.exp(rng.uniform(0.0, np.log(100.0))),
                "p_detect": rng.uniform(0.2, 1.0),
                "clutter": rng.uniform(0.0, 10.0),
                "scale": np.exp(rng.uniform(-np.log(2.0), np.log(2.0))) if s else 1.0,
                "lag": rng.uniform(0.0, 0.1) if s else 0.0,
                "noise": rng.uniform(0.01, 0.08),
                "score": rng.uniform(0.5, 0.9),
                "spread": rng.uniform(0.05, 0.3),
            }
        )
    return pair


def scan_of(sensor, place, size, rng):
    """Boxes (M, 4) left, top, width, height and scores (M,) of one scan."""
    seen = rng.random(len(place)) < sensor["p_detect"]
    wide = (size * sensor["scale"])[seen]
    boxes = np.concatenate([place[seen] - wide / 2, place[seen] + wide / 2], axis=1)
    boxes += rng.normal(0.0, sensor["noise"], boxes.shape) * wide.mean(axis=1, keepdims=True)
    stray = rng.uniform(0.0, PICTURE - 40.0, (rng.poisson(sensor["clutter"]), 2))
    false = np.concatenate([stray, stray + rng.uniform(20.0, 120.0, stray.shape)], axis=1)
    means = np.repeat([sensor["score"], sensor["score"] - 0.25], [len(boxes), len(false)])
    sides = np.concatenate([boxes, false])
    return np.concatenate([sides[:, :2], sides[:, 2:] - sides[:, :2]], axis=1), rng.normal(
        means, sensor["spread"]
    ).clip(0.01, 0.99)


def share_tracked(seed):
    """Of all moments of objects that are in the picture, and known for long enough, those of tracks."""
    rng = np.random.default_rng(seed)
    pair, count = drawn_pair(rng), int(rng.integers(2, 12))
    start, speed = rng.uniform(200.0, [1700.0, 900.0], (count, 2)), rng.normal(0.0, 60.0, (count, 2))
    size = rng.uniform(25.0, 120.0, (count, 1)) * [1.3, 1.0]
    looks = sorted(
        (t, k) for k in range(2) for t in np.arange(rng.uniform(0, 0.5), SECONDS, 1 / pair[k]["rate"])
    )
    # Five hits are to be expected within this time; or one second.
    known = max(5.0 / sum(s["rate"] * s["p_detect"] for s in pair), 1.0)
    model = compiled.Model(ModelConstants(), *PICTURE, True, -1.0)
    model.declare_sensor()
    model.declare_sensor()
    told = moments = 0
    for t, k in looks:
        boxes, scores = scan_of(pair[k], start + speed * (t - pair[k]["lag"]), size, rng)
        model.take(t, np.array([k]), np.array([len(boxes)]), boxes, logit(scores))
        centres, place = model.rows()[2].reshape(-1, 2, 5)[:, :, 0], start + speed * t
        inside = ((place > 20.0) & (place < PICTURE - 20.0)).all(axis=1)
        if t > known:
            near = (
                np.abs(centres[None] - place[:, None]).max(axis=2, initial=0.0)
                < 1.2 * size.max(axis=1)[:, None]
            )
            moments += int(inside.sum())
            told += int((near.any(axis=1) & inside).sum())
    sees = any(s["rate"] * s["p_detect"] >= 4.0 and s["p_detect"] >= 0.5 for s in pair)
    return sees, told / max(moments, 1), moments


def test_no_pair_of_sensors_is_tracked_in_silence():
    shares = [share_tracked(seed) for seed in range(12)]
    assert np.mean([share for sees, share, moments in shares if sees and moments]) > CONSISTENT
    assert np.mean([share for _, share, moments in shares if moments]) > POOR
    assert min(share for _, share, moments in shares if moments) > 0.1
