"""Average precision against cases by hand."""

import numpy as np
import pytest

from jeat_graph.data.detections import Detections, FloatArray
from jeat_graph.data.trajectories import GroundTruth

from .ap import average_precision

BOX = np.array([[0.0, 0.0, 10.0, 10.0]])
SHIFTED = np.array([[5.0, 0.0, 10.0, 10.0]])
NEXT = np.array([[30.0, 0.0, 10.0, 10.0]])
AWAY = np.array([[50.0, 0.0, 10.0, 10.0]])


def truth(boxes: FloatArray, ignore: list[bool] | None = None) -> GroundTruth:
    n = len(boxes)
    flags = np.array(ignore if ignore is not None else [False] * n, dtype=bool)
    return GroundTruth(np.zeros(n), np.arange(n), boxes, None, flags)


def found(boxes: FloatArray, scores: list[float]) -> Detections:
    return Detections.from_rows(np.zeros(len(boxes)), ["rgb"] * len(boxes), boxes, scores)


def test_perfect_detections_score_one() -> None:
    boxes = np.concatenate([BOX, NEXT])
    assert average_precision([(found(boxes, [0.9, 0.4]), truth(boxes))]) == pytest.approx(1.0)


def test_half_of_the_vehicles_found_score_51_of_101_levels() -> None:
    boxes = np.concatenate([BOX, NEXT])
    assert average_precision([(found(boxes[:1], [0.9]), truth(boxes))]) == pytest.approx(51 / 101)


def test_a_false_box_above_the_true_one_halves_the_precision() -> None:
    boxes = np.concatenate([AWAY, BOX])
    assert average_precision([(found(boxes, [0.9, 0.4]), truth(BOX))]) == pytest.approx(0.5)


def test_the_second_box_on_one_vehicle_is_false() -> None:
    boxes = np.concatenate([BOX, BOX, NEXT])
    # Precision 1 up to recall ½, then 2/3.
    expected = (51 + 50 * 2 / 3) / 101
    assert average_precision([(found(boxes, [0.9, 0.8, 0.7]), truth(boxes[1:]))]) == pytest.approx(expected)


def test_boxes_on_ignored_vehicles_do_not_count() -> None:
    boxes = np.concatenate([BOX, NEXT])
    assert average_precision([(found(boxes, [0.4, 0.9]), truth(boxes, [False, True]))]) == pytest.approx(1.0)


def test_too_little_overlap_is_no_hit() -> None:
    assert average_precision([(found(SHIFTED, [0.9]), truth(BOX))]) == 0.0


def test_without_truth_there_is_no_precision() -> None:
    assert np.isnan(average_precision([(found(BOX, [0.9]), truth(BOX[:0]))]))
