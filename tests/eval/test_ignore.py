"""Ignored truth counts neither as missed nor, where a track lies on it, as false."""

from __future__ import annotations

import numpy as np

from jeat_graph.eval.metrics import evaluate

from .data import make_tracks, make_truth

CAR = [0, 0, 40, 20]
TRUCK = [200, 0, 80, 40]


def scores(truth_boxes, ignore, track_boxes):
    truth = make_truth([0.0] * len(truth_boxes), range(len(truth_boxes)), truth_boxes, ignore)
    return evaluate([(truth, make_tracks([0.0] * len(track_boxes), range(len(track_boxes)), track_boxes))])


def test_an_ignored_object_is_not_missed():
    result = scores([CAR, TRUCK], [0, 1], [CAR])
    assert (result.TP, result.FP, result.FN) == (1, 0, 0)


def test_a_track_on_an_ignored_object_is_not_false():
    result = scores([CAR, TRUCK], [0, 1], [CAR, TRUCK])
    assert (result.TP, result.FP, result.FN) == (1, 0, 0)


def test_a_track_with_half_of_its_area_on_an_ignored_region_is_not_false():
    result = scores([CAR, TRUCK], [0, 1], [CAR, [190, 0, 20, 10]])
    assert (result.TP, result.FP) == (1, 0)


def test_a_track_with_less_than_half_of_its_area_on_an_ignored_region_is_false():
    result = scores([CAR, TRUCK], [0, 1], [CAR, [189, 0, 20, 10]])
    assert (result.TP, result.FP) == (1, 1)


def test_a_track_matched_to_an_object_stays_though_it_lies_in_an_ignored_region():
    result = scores([CAR, [-50, -50, 200, 200]], [0, 1], [CAR])
    assert (result.TP, result.FP, result.FN) == (1, 0, 0)


def test_a_track_between_an_object_and_an_ignored_one_is_given_to_the_one_it_fits_better():
    # Both overlap the track by more than a half; the match to the ignored one is the larger.
    result = scores([[0, 0, 100, 10], [20, 0, 100, 10]], [0, 1], [[18, 0, 100, 10]])
    assert (result.TP, result.FP, result.FN) == (0, 0, 1)


def test_ignored_boxes_may_share_an_identity():
    truth = make_truth([0.0, 0.0, 0.0], [-1, -1, 4], [TRUCK, [500, 0, 9, 9], CAR], [1, 1, 0])
    assert evaluate([(truth, make_tracks([0.0], [1], [CAR]))]).MOTA == 100.0


def test_a_frame_without_objects_still_has_false_tracks():
    truth = make_truth([0.0], [1], [CAR], frames=np.array([0.0, 0.1]))
    result = evaluate([(truth, make_tracks([0.0, 0.1], [1, 1], [CAR, CAR]))])
    assert (result.TP, result.FP, result.FN) == (1, 1, 0)


def test_an_empty_table_misses_everything():
    result = scores([CAR, TRUCK], [0, 0], [])
    assert (result.TP, result.FP, result.FN, result.MOTA) == (0, 0, 2, 0.0)
