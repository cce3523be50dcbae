"""Other trackers on our detections."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.baselines import baseline_frames, run_baseline
from benchmarks.baselines.inputs import suppress_overlapping
from benchmarks.baselines.roboflow import ROBOFLOW
from jeat_graph.association.overlap import pairwise_iou
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.errors import ConfigError, UnknownSensorError
from jeat_graph.eval.metrics import Scores, evaluate

from ...eval.data import KITTI, kitti, make_truth

RATE = 20.0
SPEED = np.array([60.0, -20.0])


def scene(frames=40, gap=()):
    """Two vehicles, one of them moving, at 20 Hz; nothing is found in the frames of `gap`."""
    scans = []
    for k in range(frames):
        moving = np.concatenate(([50, 400] + SPEED * k / RATE, [60, 40]))
        boxes = np.array([[300.0, 100, 60, 40], moving])
        boxes = boxes[:0] if k in gap else boxes
        scans.append(Scan(k / RATE, "rgb", boxes, np.full(len(boxes), 0.95)))
    return Detections.from_scans(scans)


def scene_truth(frames=40):
    t = np.repeat(np.arange(frames) / RATE, 2)
    parked, moving = [300.0, 100, 60, 40], [50.0, 400, 60, 40]
    boxes = np.array([parked, moving] * frames)
    boxes[1::2, :2] += SPEED * (np.arange(frames) / RATE)[:, None]
    return make_truth(t, [1, 2] * frames, boxes)


def judged(name, sequences, **parameters) -> Scores:
    """Scores of a baseline, pooled over (truth, detections)."""
    pairs = [(truth, run_baseline(name, found, ["rgb"], **parameters)) for truth, found in sequences]
    return evaluate(pairs, instants=[np.unique(found.sensor_times("rgb")) for _, found in sequences])


@pytest.fixture(autouse=True)
def _trackers():
    pytest.importorskip("trackers", reason="needs the package trackers (extra baselines)")


@pytest.mark.parametrize("name", sorted(ROBOFLOW))
def test_each_baseline_tracks_two_vehicles_without_a_switch(name):
    scores = judged(name, [(scene_truth(), scene())])
    assert (scores.FP, scores.IDSW, scores.track_ids) == (0, 0, 2)
    assert scores.FN <= 6  # the frames before confirmation


@pytest.mark.parametrize("name", sorted(ROBOFLOW))
def test_rows_carry_the_boxes_their_centres_and_the_filters_velocity(name):
    table = run_baseline(name, scene(), ["rgb"])
    np.testing.assert_allclose(table.mean[:, :2], table.boxes[:, :2] + table.boxes[:, 2:] / 2)
    last = table.take(table.t == table.t.max())
    speeds = last.mean[np.argsort(last.boxes[:, 0]), 2:4]
    np.testing.assert_allclose(speeds, [SPEED, [0, 0]], atol=6)
    assert (table.track_id >= 0).all()
    assert set(table.sensor_text()) == {"rgb"}


def test_empty_scans_are_passed_on_so_that_tracks_are_lost_in_them():
    gap = range(10, 30)  # one second without anything, with a buffer of a third of a second
    lost = run_baseline("sort", scene(gap=gap), ["rgb"], lost_track_buffer=10)
    assert len(np.unique(lost.track_id)) == 4
    kept = run_baseline("sort", scene(gap=gap), ["rgb"], lost_track_buffer=60, minimum_iou_threshold=0.05)
    assert len(np.unique(kept.track_id)) < 4


def test_boxes_below_the_least_score_are_not_shown():
    assert not len(run_baseline("sort", scene(), ["rgb"], min_score=0.96))


def two_sensors():
    a = Scan(0.10, "rgb", np.array([[0.0, 0, 40, 20]]), np.array([0.6]))
    evt = [
        Scan(0.05, "evt", np.array([[500.0, 0, 40, 20]]), np.array([0.9])),
        Scan(0.09, "evt", np.array([[1.0, 0, 40, 20], [200, 0, 40, 20]]), np.array([0.8, 0.7])),
        Scan(0.11, "evt", np.array([[600.0, 0, 40, 20]]), np.array([0.9])),
    ]
    empty = Scan(0.15, "rgb", np.zeros((0, 4)), np.zeros(0))
    late = Scan(0.20, "rgb", np.zeros((0, 4)), np.zeros(0))
    return Detections.from_scans([a, empty, late, *evt])


def test_of_several_sensors_the_first_sets_the_frames_and_the_latest_scans_are_merged():
    frames = baseline_frames(two_sensors(), ["rgb", "evt"])
    assert [frame.t for frame in frames] == [0.10, 0.15, 0.20]
    # At 0.10 the better box of the pair is that of the event camera; its scan at 0.05 is older and not used.
    assert frames[0].boxes[:, 0].tolist() == [1.0, 200.0]
    assert frames[0].sensor.tolist() == [1, 1]
    # What came after a frame belongs to the next one, and no scan is used twice.
    assert frames[1].boxes[:, 0].tolist() == [600.0]
    assert len(frames[2].boxes) == 0


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(0, 20), iou=st.floats(0.1, 0.9))
def test_suppression_keeps_no_two_that_overlap_and_drops_only_what_a_better_one_covers(seed, n, iou):
    rng = np.random.default_rng(seed)
    boxes = np.column_stack((rng.uniform(0, 60, (n, 2)), rng.uniform(10, 50, (n, 2))))
    scores = rng.random(n)
    keep = suppress_overlapping(boxes, scores, iou)
    overlap = pairwise_iou(boxes, boxes)
    assert not (np.triu(overlap[np.ix_(keep, keep)], 1) > iou).any()
    for dropped in set(range(n)) - set(keep.tolist()):
        assert any(overlap[dropped, k] > iou and scores[k] >= scores[dropped] for k in keep)


def test_mistakes_are_named():
    with pytest.raises(ConfigError, match="unknown baseline 'deepsort'; there are: sort, bytetrack"):
        run_baseline("deepsort", scene(), ["rgb"])
    with pytest.raises(ConfigError, match=r"baseline sort: .*no_such_thing"):
        run_baseline("sort", scene(), ["rgb"], no_such_thing=1)
    with pytest.raises(UnknownSensorError, match="'evt'; the detections have: rgb"):
        run_baseline("sort", scene(), ["evt"])


def test_a_baseline_run_twice_gives_the_same():
    first, second = (run_baseline("bytetrack", scene(), ["rgb"]) for _ in range(2))
    assert np.array_equal(first.track_id, second.track_id)
    assert np.array_equal(first.mean, second.mean)


def test_sort_and_bytetrack_on_the_kitti_camera_detections_score_as_they_are_known_to():
    sequences = [kitti(name) for name in KITTI]
    for name in ("sort", "bytetrack"):
        scores = judged(name, sequences)
        assert 82 < scores.MOTA < 85
        assert 88 < scores.IDF1 < 92
