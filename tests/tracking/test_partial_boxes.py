"""A box that shows a part of a vehicle is no second vehicle."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph import Scan, Tracker

RATE_HZ, SPEED, WIDTH, HEIGHT = 25.0, 200.0, 110.0, 70.0


def cut(box, side, share):
    """The part of a box that is left where it is cut to a share from the other side(s)."""
    left, top, width, height = box
    if "left" in side:
        left, width = left + width * (1 - share), width * share
    if "right" in side:
        width *= share
    if "top" in side:
        top, height = top + height * (1 - share), height * share
    if "bottom" in side:
        height *= share
    return np.array([left, top, width, height])


#: By kind: what share shows at t (s) in scan k, 1 for all of it, None for no box at all.
KINDS = {
    "for a second": lambda t, k: 0.4 if 2 <= t < 3 else 1,
    "mildly": lambda t, k: 0.9 if 2 <= t < 3 else 1,
    "for three seconds": lambda t, k: 0.4 if 1.5 <= t < 4.5 else 1,
    "once": lambda t, k: 0.4 if k == 50 else 1,
    "in every second scan": lambda t, k: 0.4 if 2 <= t < 4 and k % 2 else 1,
    "in a third of the scans": lambda t, k: 0.4 if t > 1 and k % 3 == 0 else 1,
    "little by little": lambda t, k: 1 - 0.6 * (1 - abs(t - 3)) if 2 <= t < 4 else 1,
    "for good": lambda t, k: 0.4 if t >= 2 else 1,
    "from the beginning": lambda t, k: 0.4 if t < 2 else 1,
    "after a gap": lambda t, k: None if 2 <= t < 2.5 else 0.4 if 2.5 <= t < 3.2 else 1,
}


def identities(share_at, sides, score=lambda share: 0.9):
    rng = np.random.default_rng(0)
    tracker, found = Tracker(image=(1920, 1080)), set()
    for k in range(int(6 * RATE_HZ)):
        t = k / RATE_HZ
        share = share_at(t, k)
        boxes = np.zeros((0, 4))
        if share is not None:
            whole = np.array([100.0 + SPEED * t, 400.0, WIDTH, HEIGHT])
            boxes = (cut(whole, sides[k % len(sides)], share) + rng.normal(0, 1, 4))[None]
        scores = np.full(len(boxes), score(share))
        found |= set(tracker.step(Scan(t, "rgb", boxes, scores)).track_id.tolist())
    return found


@pytest.mark.parametrize("side", ["left", "bottom"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_box_cut_from_one_side_keeps_its_track(kind, side):
    assert len(identities(KINDS[kind], [side])) == 1


def test_neither_a_lower_score_nor_another_end_each_time_nor_a_mild_corner_makes_a_second_vehicle():
    second = KINDS["for a second"]
    assert len(identities(second, ["right"], lambda share: 0.5 if share == 0.4 else 0.9)) == 1
    assert len(identities(second, ["left", "right"])) == 1
    assert len(identities(lambda t, k: 0.6 if 2 <= t < 3 else 1, ["left bottom"])) == 1
