"""Scores of groups of objects, and how long it takes until they are found or found again."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.eval.breakdown import by_distance, by_motion, confirmation_latency, recovery_times
from jeat_graph.eval.frames import build_frames

from .data import make_tracks, make_truth

DT = 0.1


def one_object(present, tracked, ignore=None):
    """One object, present and tracked (by the track of that number, 0 for none) in frames given by digits."""
    n = len(present)
    at = np.array([int(c) for c in present], dtype=bool)
    by = np.array([int(c) for c in tracked])
    frames = np.arange(n) * DT
    box = np.tile([0.0, 0, 40, 20], (n, 1))
    truth = make_truth(frames[at], [1] * at.sum(), box[at], ignore, frames=frames)
    return build_frames(truth, make_tracks(frames[by > 0], by[by > 0], box[by > 0]), instants=frames)


def test_latency_is_the_time_from_the_first_frame_to_the_first_track():
    delays = confirmation_latency([one_object("0011111", "0000111"), one_object("1111111", "1111111")])
    assert (delays.count, delays.never) == (2, 0)
    assert delays.mean_s == pytest.approx((2 * DT + 0) / 2)


def test_an_object_never_tracked_is_counted_apart():
    delays = confirmation_latency([one_object("1111", "0000")])
    assert (delays.count, delays.never) == (0, 1)
    assert np.isnan(delays.mean_s)


def test_time_to_recover_after_a_miss():
    times = recovery_times([one_object("1111111", "1100011")])
    assert times["miss"].count == 1
    assert times["miss"].mean_s == pytest.approx(3 * DT)
    assert times["occlusion"].count == 0


def test_time_to_recover_after_an_occlusion_counts_from_the_return():
    times = recovery_times([one_object("11001111", "11000011")])
    assert (times["miss"].count, times["occlusion"].count) == (0, 1)
    assert times["occlusion"].mean_s == pytest.approx(2 * DT)


def test_an_object_tracked_at_once_after_an_occlusion_recovers_in_no_time():
    times = recovery_times([one_object("110011", "110011")])
    assert (times["occlusion"].count, times["occlusion"].mean_s) == (1, 0.0)


def test_being_ignored_for_a_while_is_an_occlusion():
    times = recovery_times([one_object("111111", "110001", ignore=[0, 0, 1, 1, 0, 0])])
    assert times["occlusion"].mean_s == pytest.approx(DT)


def test_an_object_lost_for_good_never_recovers():
    times = recovery_times([one_object("11111", "11000")])
    assert (times["miss"].count, times["miss"].never) == (0, 1)


def test_an_object_never_seen_before_its_occlusion_has_nothing_to_recover():
    times = recovery_times([one_object("110011", "000011")])
    assert times["occlusion"].count + times["occlusion"].never == 0


def test_objects_do_not_mix():
    truth = make_truth([0, 0.1, 0, 0.1], [1, 1, 2, 2], [[0, 0, 9, 9]] * 2 + [[50, 0, 9, 9]] * 2)
    tracks = make_tracks([0, 0.1, 0.1], [1, 1, 2], [[0, 0, 9, 9]] * 2 + [[50, 0, 9, 9]])
    times = recovery_times([build_frames(truth, tracks)])
    assert times["miss"].count + times["miss"].never == 0


def two_objects(**more):
    t = [0.0, 0.1, 0.2] * 2
    boxes = [[0, 0, 40, 20]] * 3 + [[100, 0, 40, 20]] * 3
    motion = np.zeros((6, 6))
    motion[3:, 2] = 90.0
    truth = make_truth(t, [1, 1, 1, 2, 2, 2], boxes, motion=motion, **more)
    return build_frames(truth, make_tracks(t[1:], [1, 1, 2, 3, 2], boxes[1:]))


def test_standing_and_moving_objects_are_scored_apart():
    standing, moving = by_motion([two_objects()])
    assert (standing.truth_boxes, standing.recall, standing.IDSW) == (3, pytest.approx(200 / 3), 0)
    assert (moving.truth_boxes, moving.recall, moving.IDSW) == (3, 100.0, 2)
    assert moving.MOTP == 100.0


def test_objects_are_scored_by_distance():
    near, far = by_distance([two_objects(distance=np.array([10.0] * 3 + [75.0] * 3))], bins_m=(0, 50, np.inf))
    assert (near.group, near.truth_boxes, near.recall) == ("0-50 m", 3, pytest.approx(200 / 3))
    assert (far.group, far.truth_boxes, far.recall) == ("over 50 m", 3, 100.0)


def test_what_the_truth_does_not_know_is_left_out():
    frames = one_object("11", "11")
    assert by_motion([frames]) == []
    assert by_distance([frames]) == []
