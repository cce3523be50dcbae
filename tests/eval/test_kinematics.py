"""Errors of motion on matched pairs, and NEES of estimates whose variances are true."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.eval.frames import build_frames
from jeat_graph.eval.kinematics import kinematic_errors

from .data import make_tracks, make_truth


def moving_truth(n=50, objects=40):
    t, ids = np.repeat(np.arange(n) * 0.05, objects), np.tile(np.arange(objects), n)
    motion = np.column_stack((100.0 * ids, 50 + 20 * t, 0 * t, 20 + 0 * t, 0 * t, 0 * t))
    boxes = np.column_stack((motion[:, :2] - [20, 10], np.tile([40, 20], (len(t), 1))))
    return t, ids, motion, boxes


def judge(t, ids, motion, boxes, tracks, **options):
    truth = make_truth(t, ids, boxes, motion=motion)
    return kinematic_errors([build_frames(truth, tracks)], **options)


def test_constant_errors_are_the_root_mean_square_errors():
    t, ids, motion, boxes = moving_truth()
    wrong = motion + np.array([3, 4, 6, 8, 5, 12])
    tracks = make_tracks(
        t, ids, boxes + np.array([3, 4, 0, 0]), motion=wrong[:, 2:], var=np.ones((len(t), 6))
    )
    errors = judge(t, ids, motion, boxes, tracks)
    assert errors.position_rmse == pytest.approx(5.0)
    assert errors.velocity_rmse == pytest.approx(10.0)
    assert errors.acceleration_rmse == pytest.approx(13.0)
    assert errors.nees == pytest.approx(25.0)


def test_nees_of_honest_variances_lies_in_its_interval_and_of_boastful_ones_above():
    rng = np.random.default_rng(5)
    t, ids, motion, boxes = moving_truth()
    noise = rng.normal(0, [1.5, 0.5], (len(t), 2))
    var = np.tile([1.5**2, 0.5**2, 1, 1, 1, 1], (len(t), 1))
    shifted = boxes + np.column_stack((noise, 0 * noise))
    honest = judge(t, ids, motion, boxes, make_tracks(t, ids, shifted, motion=motion[:, 2:], var=var))
    assert honest.nees_low < honest.nees < honest.nees_high
    assert honest.nees_low < 2.0 < honest.nees_high
    boastful = judge(t, ids, motion, boxes, make_tracks(t, ids, shifted, motion=motion[:, 2:], var=var / 4))
    assert boastful.nees == pytest.approx(4 * honest.nees)


def test_boxes_cut_off_by_the_edge_are_left_out_unless_asked_for():
    t, ids, motion, boxes = moving_truth()
    cut = ids == 0
    boxes[cut, 0], boxes[cut, 2] = 0.0, 20.0
    tracks = make_tracks(t, ids, boxes, motion=motion[:, 2:])
    errors = judge(t, ids, motion, boxes, tracks)
    assert (errors.truncated_pairs, errors.position_rmse) == (50, 0.0)
    assert judge(t, ids, motion, boxes, tracks, include_truncated=True).position_rmse > 1.0


def test_a_table_of_boxes_alone_has_no_velocity_error_and_no_nees():
    t, ids, motion, boxes = moving_truth()
    errors = judge(t, ids, motion, boxes, make_tracks(t, ids, boxes))
    assert errors.position_rmse == 0.0
    assert np.isnan([errors.velocity_rmse, errors.acceleration_rmse, errors.nees]).all()


def test_truth_without_motion_gives_no_errors():
    t, ids, _, boxes = moving_truth()
    assert judge(t, ids, None, boxes, make_tracks(t, ids, boxes)) is None


def test_unmatched_tracks_do_not_count():
    t, ids, motion, boxes = moving_truth()
    off = boxes + np.where(ids == 1, 1.0, 0.0)[:, None] * [0, 500, 0, 0]
    assert judge(t, ids, motion, boxes, make_tracks(t, ids, off)).position_rmse == 0.0


def test_nees_is_not_taken_of_long_predictions():
    t, ids, motion, boxes = moving_truth()
    early = make_tracks(t - 0.03, ids, boxes, motion=motion[:, 2:], var=np.ones((len(t), 6)))
    errors = judge(t, ids, motion, boxes, early)
    assert (errors.pairs, errors.nees_pairs) == (len(t), 0)
