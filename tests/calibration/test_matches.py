"""Detections are matched with the truth at their own time."""

import numpy as np
import pytest

from jeat_graph.calibration.matches import match_sensor
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth


def truth(rows, ignore=()):
    t, ids, boxes = zip(*rows, strict=True)
    return GroundTruth(
        t=np.array(t, dtype=float),
        object_id=np.array(ids),
        boxes=np.array(boxes, dtype=float),
        motion=None,
        ignore=np.isin(np.arange(len(t)), ignore),
    )


def scans(*items):
    return Detections.from_scans(
        Scan(t, "rgb", np.array(boxes, dtype=float).reshape(-1, 4), np.full(len(boxes), 0.5))
        for t, boxes in items
    )


def test_truth_is_interpolated_to_the_time_of_a_scan_between_frames():
    g = truth([(0.0, 1, (0, 0, 40, 40)), (0.1, 1, (20, 0, 40, 40))])
    m = match_sensor(scans((0.05, [(10, 0, 40, 40)])), g, "rgb")
    np.testing.assert_allclose(m.residual, 0.0, atol=1e-12)
    np.testing.assert_allclose(m.speed, 200.0)


def test_residuals_are_in_units_of_the_true_box():
    g = truth([(0.0, 1, (0, 0, 40, 20))])
    m = match_sensor(scans((0.0, [(4, 1, 40, 20)])), g, "rgb")
    np.testing.assert_allclose(m.residual, [[0.1, 0.05, 0.0, 0.0]], atol=1e-12)


def test_a_detection_on_an_ignored_box_counts_neither_way():
    g = truth([(0.0, 1, (0, 0, 40, 40)), (0.0, 2, (200, 0, 80, 80))], ignore=(1,))
    m = match_sensor(scans((0.0, [(0, 0, 40, 40), (210, 10, 30, 30)])), g, "rgb")
    assert m.correct.tolist() == [True]
    assert m.seen.tolist() == [True]


def test_a_false_box_is_no_vehicle_and_sees_none():
    g = truth([(0.0, 1, (0, 0, 40, 40))])
    m = match_sensor(scans((0.0, [(500, 100, 30, 30)])), g, "rgb")
    assert m.correct.tolist() == [False]
    assert m.seen.tolist() == [False]


@pytest.mark.parametrize("there", [0.0, 0.1])
def test_a_vehicle_that_enters_or_leaves_between_two_frames_counts_neither_way(there):
    g = truth([(0.0, 1, (0, 0, 40, 40)), (0.1, 1, (0, 0, 40, 40)), (there, 2, (600, 0, 40, 40))])
    m = match_sensor(scans((0.05, [(0, 0, 40, 40), (605, 0, 40, 40)])), g, "rgb")
    assert m.correct.tolist() == [True]
    assert m.seen.tolist() == [True]


@pytest.mark.parametrize("entering", [True, False])
def test_one_that_drives_further_than_its_length_between_two_frames_counts_neither_way(entering):
    rows = [(k / 10, 1, (0, 0, 40, 40)) for k in range(4)]
    rows += [(k / 10, 2, (200 + 60 * k, 0, 40, 40)) for k in ((1, 2, 3) if entering else (0, 1, 2))]
    t = 0.02 if entering else 0.28
    m = match_sensor(scans((t, [(0, 0, 40, 40), (200 + 600 * t, 0, 40, 40)])), truth(sorted(rows)), "rgb")
    assert m.correct.tolist() == [True]


def test_scans_outside_the_truth_are_not_judged():
    g = truth([(1.0, 1, (0, 0, 40, 40)), (1.1, 1, (0, 0, 40, 40))])
    with pytest.raises(DataError, match="'rgb' lies within the time span"):
        match_sensor(scans((0.0, [(0, 0, 40, 40)]), (5.0, [])), g, "rgb")
