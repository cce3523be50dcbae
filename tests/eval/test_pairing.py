"""Files that do not belong together are refused with a sentence that says what is wrong."""

from __future__ import annotations

import re

import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.eval.load import check_classes, restrict_classes
from jeat_graph.eval.metrics import evaluate
from jeat_graph.eval.pairing import check_lives

from .data import make_tracks, make_truth

T = np.arange(100) * 0.05
BOX = np.tile([10.0, 10.0, 40.0, 20.0], (100, 1))


def judge(truth, tracks):
    return evaluate([(truth, tracks)])


def test_no_common_timestamps():
    with pytest.raises(DataError, match=r"no common timestamps: the truth covers 0 to 4\.95 s"):
        judge(make_truth(T, [1] * 100, BOX), make_tracks(T + 1000, [1] * 100, BOX))


@pytest.mark.parametrize("factor", [1000.0, 20.0, 1e6, 1e-3])
def test_different_units_of_time(factor):
    with pytest.raises(DataError, match=re.escape(f"tracks last {factor:.3g} times as long as the truth")):
        judge(make_truth(T, [1] * 100, BOX), make_tracks(T * factor, [1] * 100, BOX))


@pytest.mark.parametrize(("frames", "instants"), [(3, 3), (3, 100), (100, 3)])
def test_three_frames_tell_their_unit(frames, instants):
    truth = make_truth(T[:frames], [1] * frames, BOX[:frames])
    with pytest.raises(DataError, match="different units of time"):
        judge(truth, make_tracks(T[:instants] * 1e6, [1] * instants, BOX[:instants]))


def test_different_units_of_time_at_different_rates():
    fast = np.arange(500) * 10.0  # 100 Hz in milliseconds
    with pytest.raises(DataError, match="times of the tracks seem to be milliseconds or frames"):
        judge(make_truth(T, [1] * 100, BOX), make_tracks(fast, [1] * 500, np.tile(BOX[0], (500, 1))))


def test_a_faster_tracker_and_one_that_ends_early_are_fine():
    fast = np.arange(500) * 0.01
    judge(make_truth(T, [1] * 100, BOX), make_tracks(fast, [1] * 500, np.tile(BOX[0], (500, 1))))
    judge(make_truth(T, [1] * 100, BOX), make_tracks(T[:10], [1] * 10, BOX[:10]))


def test_truth_without_identities():
    with pytest.raises(DataError, match="no identities: every object_id is -1"):
        judge(make_truth([0.0, 0.0], [-1, -1], BOX[:2]), make_tracks([0.0], [1], BOX[:1]))


def test_truth_whose_identities_are_numbers_of_rows():
    truth = make_truth(T, np.arange(100), BOX)
    with pytest.raises(
        DataError, match="no identities: each of its 100 boxes in 100 frames has an object_id of"
    ):
        judge(truth, make_tracks(T, [1] * 100, BOX))
    judge(make_truth([0.0, 0.05], [1, 2], BOX[:2]), make_tracks([0.0, 0.05], [1, 1], BOX[:2]))
    judge(make_truth(T, np.arange(100) // 2, BOX), make_tracks(T, [1] * 100, BOX))


def test_an_object_twice_in_one_frame():
    with pytest.raises(DataError, match="object 3 twice at t = 0 s"):
        judge(make_truth([0.0, 0.0, 0.0], [3, 3, 4], BOX[:3]), make_tracks([0.0], [1], BOX[:1]))


def test_truth_without_frames():
    with pytest.raises(DataError, match="no frames"):
        judge(make_truth([], [], []), make_tracks([0.0], [1], BOX[:1]))


@pytest.mark.parametrize(("truth", "tracks", "which"), [(1, 1280, "tracks"), (1280, 1, "truth")])
def test_boxes_relative_to_the_picture(truth, tracks, which):
    with pytest.raises(DataError, match=f"different units: the boxes of the {which} lie within 0.0"):
        judge(make_truth(T, [1] * 100, BOX / truth), make_tracks(T, [1] * 100, BOX / tracks))


def test_boxes_relative_to_the_picture_on_both_sides_are_of_one_unit():
    scores = judge(make_truth(T, [1] * 100, BOX / 1280), make_tracks(T, [1] * 100, BOX / 1280))
    assert scores.MOTA == 100.0


def test_no_common_timestamps_though_one_covers_the_other():
    ends = (T < 1.0) | (T > 4.0)
    truth = make_truth(T[ends], [1] * ends.sum(), BOX[ends])
    middle = (T > 2.0) & (T < 3.0)
    with pytest.raises(DataError, match="no track is there at any of the truth's 39 frames"):
        check_lives(truth, make_tracks(T[middle], [1] * middle.sum(), BOX[middle]))


@pytest.mark.parametrize("times", [[0.5, 4.5], [0.9, 0.91], [4.5, 4.6]])
def test_a_track_over_a_single_frame_of_the_truth_is_common_enough(times):
    ends = (T < 1.0) | (T > 4.0)
    check_lives(make_truth(T[ends], [1] * ends.sum(), BOX[ends]), make_tracks(times, [1, 1], BOX[:2]))


def test_no_sequence_and_a_threshold_out_of_range():
    with pytest.raises(DataError, match="no sequence"):
        evaluate([])
    with pytest.raises(DataError, match="IoU threshold"):
        evaluate([(make_truth([0.0], [1], BOX[:1]), make_tracks([0.0], [1], BOX[:1]))], iou=0.0)


def test_a_class_that_is_not_there_is_named_with_those_that_are():
    truth = make_truth([0.0, 0.0], [1, 2], BOX[:2], classes=np.array(["Car", "Van"]))
    assert restrict_classes(truth, ["Van"]).ignore.tolist() == [True, False]
    with pytest.raises(DataError, match="the truth has: Car, Van"):
        check_classes([truth], ["car"])


def test_classes_that_are_numbers_are_named_with_what_names_them():
    truth = make_truth([0.0], [1], BOX[:1], classes=np.array(["3"]))
    with pytest.raises(
        DataError, match=r"the truth has: 3 \(--classes FILE names them, in Python class_names=\)"
    ):
        check_classes([truth], ["car"])


def test_a_truth_without_a_class_that_another_has_is_judged_with_nothing_to_find():
    cars = make_truth([0.0], [1], BOX[:1], classes=np.array(["Car"]))
    vans = make_truth([0.0], [1], BOX[:1], classes=np.array(["Van"]))
    check_classes([cars, vans], ["Car"])
    assert restrict_classes(vans, ["Car"]).ignore.all()
