"""Consistency of positions: sums written out, and a Monte Carlo whose variances are true."""

import numpy as np
import pytest

from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.eval.position_nees import position_nees


def made(error, std, boxes=None):
    """Truth of still boxes, one a frame, and a table whose centres are off by `error` (K, 2)."""
    count = len(error)
    t = 0.1 * np.arange(count)
    if boxes is None:
        boxes = np.tile([100.0, 100.0, 200.0, 100.0], (count, 1))
    # A box at the far corner of the first frame says how far the picture reaches.
    all_boxes = np.vstack([boxes, [[900.0, 900.0, 100.0, 100.0]]])
    truth = GroundTruth(
        t=np.append(t, t[0]),
        object_id=np.append(np.full(count, 1), 2),
        boxes=all_boxes,
        motion=None,
        ignore=np.zeros(count + 1, dtype=bool),
    )
    moved = boxes.copy()
    moved[:, :2] += error
    mean, var = np.zeros((count, 6)), np.ones((count, 6))
    mean[:, :2] = moved[:, :2] + 0.5 * moved[:, 2:]
    var[:, :2] = std**2
    one = np.full(count, 1)
    return truth, Trajectories(t, one, moved, np.full(count, 0.9), mean, var, one, ("rgb",))


def test_it_is_the_mean_of_the_squared_errors_over_their_variances():
    error = np.array([[3.0, 0.0], [0.0, 4.0], [1.0, 2.0]])
    found = position_nees([made(error, 2.0)])
    assert found.anees == pytest.approx(np.sum(error**2) / 4.0 / 6.0)
    assert found.matched == 3


def test_true_variances_give_one_and_ninety_five_per_cent():
    error = np.random.default_rng(0).normal(0.0, 3.0, (4000, 2))
    found = position_nees([made(error, 3.0)])
    assert found.anees == pytest.approx(1.0, abs=4.0 / np.sqrt(4000))
    assert found.coverage == pytest.approx(0.95, abs=0.015)


def test_boxes_that_touch_the_edge_of_the_picture_do_not_count():
    boxes = np.tile([100.0, 100.0, 200.0, 100.0], (3, 1))
    boxes[1, 0] = 2.0
    found = position_nees([made(np.ones((3, 2)), 1.0, boxes)])
    assert (found.matched, found.anees) == (2, pytest.approx(1.0))


def test_nothing_that_matches_is_no_number():
    found = position_nees([made(np.full((3, 2), 400.0), 1.0)])
    assert found.matched == 0
    assert np.isnan(found.anees)
