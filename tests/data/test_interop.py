"""Objects of other libraries as detections."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.interop import boxes_of, from_xyxy, to_xyxy

CORNERS = np.array([[10.0, 20.0, 50.0, 80.0], [0.0, 0.0, 5.0, 6.0]])
BOXES = np.array([[10.0, 20.0, 40.0, 60.0], [0.0, 0.0, 5.0, 6.0]])


def test_corners_and_sizes_are_two_ways_to_say_one_box():
    assert np.array_equal(from_xyxy(CORNERS), BOXES)
    assert np.array_equal(to_xyxy(BOXES), CORNERS)


def test_an_array_of_five_columns_brings_its_scores():
    found = boxes_of(np.hstack([BOXES, [[0.3], [0.7]]]))
    assert np.array_equal(found.boxes, BOXES)
    assert found.scores.tolist() == [0.3, 0.7]
    assert boxes_of(BOXES).scores.tolist() == [1.0, 1.0]
    assert boxes_of([]).boxes.shape == (0, 4)


def test_supervision_detections_keep_boxes_scores_and_class_names():
    sv = pytest.importorskip("supervision")
    source = sv.Detections(
        xyxy=CORNERS,
        confidence=np.array([0.9, 0.4]),
        class_id=np.array([2, 7]),
        data={"class_name": np.array(["car", "truck"])},
    )
    found = boxes_of(source)
    assert np.array_equal(found.boxes, BOXES)
    assert found.scores.tolist() == [0.9, 0.4]
    assert found.classes.tolist() == ["car", "truck"]
    assert boxes_of(sv.Detections.empty()).boxes.shape == (0, 4)


class Tensor:
    """A tensor that lives elsewhere, as torch's do."""

    def __init__(self, values):
        self._values = values

    def cpu(self):
        return np.asarray(self._values)


@pytest.mark.parametrize("names", [{2: "car", 7: "truck"}, ["a", "b", "car", "", "", "", "", "truck"]])
def test_results_of_ultralytics_are_known_by_their_attributes(names):
    boxes = SimpleNamespace(xyxy=Tensor(CORNERS), conf=Tensor([0.9, 0.4]), cls=Tensor([2.0, 7.0]))
    result = SimpleNamespace(boxes=boxes, names=names)
    for source in (result, [result]):
        found = boxes_of(source)
        assert np.array_equal(found.boxes, BOXES)
        assert found.classes.tolist() == ["car", "truck"]


@pytest.mark.parametrize("source", ["boxes", object(), np.zeros((2, 3)), np.zeros(4)])
def test_what_is_no_box_is_refused_with_what_would_be(source):
    with pytest.raises(DataError, match="boxes"):
        boxes_of(source)


@pytest.mark.parametrize(
    "names",
    [
        {"width": 2, "height": 3, "left": 0, "top": 1, "score": 6, "class": 7},
        {"conf": 6, "X1": 0, "y1": 1, "x2": 4, "y2": 5, "label": 7, "frame": 6},
        {"cx": 8, "cy": 9, "w": 2, "h": 3, "confidence": 6, "class_name": 7},
    ],
)
def test_columns_of_a_data_frame_go_by_their_names(names):
    pd = pytest.importorskip("pandas")
    all_columns = [*BOXES.T, *CORNERS.T[2:], [0.3, 0.7], ["car", None], *(BOXES[:, :2] + BOXES[:, 2:] / 2).T]
    frame = pd.DataFrame({name: all_columns[k] for name, k in names.items()})
    found = boxes_of(frame)
    assert found.boxes.tolist() == BOXES.tolist()
    assert found.scores.tolist() == [0.3, 0.7]
    assert found.classes.tolist() == ["car", ""]
    assert boxes_of(frame, [0.1, 0.2]).scores.tolist() == [0.1, 0.2]


def test_columns_that_are_only_numbered_go_by_their_order():
    pd = pytest.importorskip("pandas")
    assert boxes_of(pd.DataFrame(BOXES)).boxes.tolist() == BOXES.tolist()


def test_unknown_columns_are_refused_with_those_that_are_known():
    pd = pytest.importorskip("pandas")
    with pytest.raises(DataError, match="need the column left; the table has x, y, w, h; known are"):
        boxes_of(pd.DataFrame(BOXES, columns=["x", "y", "w", "h"]))
    with pytest.raises(DataError, match="column 'width' must hold numbers, not 'wide'"):
        boxes_of(pd.DataFrame({"left": [1], "top": [2], "width": ["wide"], "height": [4]}))


class Learning:
    """A tensor that takes part in learning, as torch's do: it is no array until it is detached."""

    def __array__(self, dtype=None, copy=None):
        raise RuntimeError("Can't call numpy() on Tensor that requires grad")

    def detach(self):
        return Tensor(BOXES)


def test_a_tensor_that_requires_grad_is_detached():
    assert boxes_of(Learning()).boxes.tolist() == BOXES.tolist()


@pytest.mark.parametrize("side", [2, 3])
def test_a_box_without_area_is_left_out_of_what_a_detector_gives(side):
    boxes = BOXES.copy()
    boxes[0, side] = 0.0
    found = boxes_of(boxes, [0.3, 0.7])
    assert found.boxes.tolist() == BOXES[1:].tolist()
    assert found.scores.tolist() == [0.7]
    assert found.kept.tolist() == [False, True]


@pytest.mark.parametrize("bad", [-1.0, np.nan, np.inf])
def test_a_box_that_is_worse_than_without_area_stays_to_be_refused(bad):
    assert len(boxes_of([[10.0, 20.0, bad, 0.0]]).boxes) == 1


def test_supervision_s_boxes_without_area_are_counted():
    sv = pytest.importorskip("supervision")
    corners = CORNERS.copy()
    corners[0, 2] = corners[0, 0]
    found = Detections.from_supervision(sv.Detections(xyxy=corners), t=0.5)
    assert (len(found), found.num_scans, found.dropped) == (1, 1, 1)
    found = Detections.from_supervision(sv.Detections(xyxy=corners[:1]), t=0.5)
    assert (len(found), found.num_scans, found.dropped) == (0, 1, 1)
