"""COCO average precision of raw detections."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.eval.detection_ap import detection_ap, nearest_scans

from .data import make_truth

A, B, FAR = [0.0, 0, 40, 20], [100.0, 0, 40, 20], [900.0, 0, 40, 20]


def detections(rows, empty_t=()):
    t = [row[0] for row in rows] + list(empty_t)
    return Detections.from_rows(
        t=t,
        sensor=["rgb"] * len(t),
        boxes=[row[1] for row in rows] + [[np.nan] * 4] * len(empty_t),
        scores=[row[2] for row in rows] + [np.nan] * len(empty_t),
        empty=[False] * len(rows) + [True] * len(empty_t),
    )


def ap(truth, rows, empty_t=(), **options):
    return detection_ap([(truth, detections(rows, empty_t))], **options)["rgb"]


def test_perfect_detections_have_100():
    result = ap(make_truth([0, 0], [1, 2], [A, B]), [(0, A, 0.9), (0, B, 0.2)])
    assert (result.AP, result.AP50, result.recall50) == (100.0, 100.0, 100.0)


def test_a_false_detection_between_two_hits_costs_precision_at_the_second():
    # Precision 1 up to recall 1/2 (recalls 0 … 0.5: 51 points), then 2/3 (50 points).
    result = ap(make_truth([0, 0], [1, 2], [A, B]), [(0, A, 0.9), (0, FAR, 0.5), (0, B, 0.2)])
    assert pytest.approx(100 * (51 + 50 * 2 / 3) / 101) == result.AP50


def test_a_second_detection_of_one_object_is_false():
    result = ap(make_truth([0, 0], [1, 2], [A, B]), [(0, A, 0.9), (0, A, 0.5), (0, B, 0.2)])
    assert pytest.approx(100 * (51 + 50 * 2 / 3) / 101) == result.AP50


def test_a_box_of_iou_0_8_counts_up_to_that_threshold():
    result = ap(make_truth([0], [1], [A]), [(0, [0.0, 0, 32.4, 20], 0.9)])
    assert (100.0, 100.0, pytest.approx(70.0)) == (result.AP50, result.AP75, result.AP)


def test_an_empty_scan_is_a_miss():
    result = ap(make_truth([0, 1], [1, 1], [A, A]), [(0, A, 0.9)], empty_t=[1.0])
    assert (result.frames, result.truth_boxes, result.recall50) == (2, 2, 50.0)
    assert pytest.approx(100 * 51 / 101) == result.AP50


def test_frames_without_a_scan_are_left_out():
    result = ap(make_truth([0, 1], [1, 1], [A, A]), [(0.004, A, 0.9)])
    assert (result.frames, result.AP) == (1, 100.0)


def test_ignored_truth_counts_neither_way():
    truth = make_truth([0, 0], [1, 2], [A, B], [0, 1])
    assert ap(truth, [(0, A, 0.5)]).AP == 100.0
    assert ap(truth, [(0, B, 0.9), (0, [110.0, 5, 10, 10], 0.8), (0, A, 0.5)]).AP == 100.0
    assert pytest.approx(50.0) == ap(truth, [(0, FAR, 0.9), (0, A, 0.5)]).AP


def test_a_moving_object_is_judged_where_it_is_at_the_time_of_the_scan():
    truth = make_truth([0], [1], [A], motion=np.array([[20.0, 10, 2000, 0, 0, 0]]))
    assert ap(truth, [(0.008, [16.0, 0, 40, 20], 0.9)]).AP == 100.0


def test_a_sensor_without_a_scan_near_a_frame_is_refused():
    with pytest.raises(DataError, match="no scan of sensor rgb lies within"):
        ap(make_truth([0], [1], [A]), [(5.0, A, 0.9)])


def test_of_a_faster_sensor_the_nearest_scans_are_taken_each_once():
    frames, scans = np.arange(5) * 0.05, np.arange(25) * 0.01 + 0.002
    frame, scan = nearest_scans(frames, scans, 0.01)
    assert frame.tolist() == [0, 1, 2, 3, 4]
    assert scan.tolist() == [0, 5, 10, 15, 20]
    frame, scan = nearest_scans(scans, frames, 0.01)
    assert len(np.unique(scan)) == len(scan) == 5


def test_random_detections_have_the_ap_of_supervision():
    sv = pytest.importorskip("supervision", reason="needs supervision as oracle")
    metrics = pytest.importorskip("supervision.metrics", reason="needs supervision as oracle")
    rng = np.random.default_rng(11)
    rows, truth_t, truth_boxes, predictions, targets = [], [], [], [], []

    def corners(boxes):
        return np.column_stack((boxes[:, :2], boxes[:, :2] + boxes[:, 2:]))

    for frame in range(40):
        count = int(rng.integers(1, 6))
        boxes = np.column_stack((rng.uniform(0, 300, (count, 2)), rng.uniform(40, 90, (count, 2))))
        found = boxes[rng.random(count) < 0.8]
        found = found + rng.normal(0, 5, found.shape)
        clutter = np.column_stack((rng.uniform(0, 300, (2, 2)), rng.uniform(40, 90, (2, 2))))
        seen = np.concatenate((found, clutter))
        score = rng.permutation(1000)[: len(seen)] / 1000 * 0.9 + frame * 1e-5  # no ties: their order is free
        truth_t += [float(frame)] * count
        truth_boxes.append(boxes)
        rows += [(float(frame), box, s) for box, s in zip(seen, score, strict=True)]
        predictions.append(sv.Detections(corners(seen), confidence=score, class_id=np.zeros(len(seen), int)))
        targets.append(sv.Detections(corners(boxes), class_id=np.zeros(count, int)))
    truth_boxes = np.concatenate(truth_boxes)
    ours = ap(make_truth(truth_t, np.arange(len(truth_t)), truth_boxes), rows)
    # Their precision is single.
    theirs = metrics.MeanAveragePrecision().update(predictions, targets).compute()
    assert pytest.approx(100 * theirs.map50_95, abs=1e-4) == ours.AP
    assert pytest.approx(100 * theirs.map50, abs=1e-4) == ours.AP50
    assert pytest.approx(100 * theirs.map75, abs=1e-4) == ours.AP75


def test_only_objects_of_a_size_are_asked_for():
    """A small and a large object are found, and a small box is false: it hurts among the small ones alone."""
    truth = GroundTruth(
        t=np.zeros(2),
        object_id=np.array([1, 2]),
        boxes=np.array([[0.0, 0, 8, 8], [100, 0, 40, 40]]),
        motion=None,
        ignore=np.zeros(2, dtype=bool),
    )
    boxes = np.array([[0.0, 0, 8, 8], [100, 0, 40, 40], [50, 50, 6, 6]])
    found = Detections.from_scans([Scan(0.0, "rgb", boxes, np.array([0.5, 0.5, 0.9]))])
    large = detection_ap([(truth, found)], sides_px=(12.0, np.inf))["rgb"]
    small = detection_ap([(truth, found)], sides_px=(0.0, 12.0))["rgb"]
    assert (large.AP50, large.truth_boxes) == (100.0, 1)
    assert (small.AP50, small.truth_boxes) == (pytest.approx(50.0), 1)
