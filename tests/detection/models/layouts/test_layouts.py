"""Every layout is recognised, and its rows become the boxes that they were made of."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.detection.models.exports import export_of
from jeat_graph.detection.models.layouts.numbers import cells
from jeat_graph.detection.models.layouts.record import Network
from jeat_graph.detection.models.layouts.registry import decode
from jeat_graph.detection.models.layouts.registry import recognise as recognise_network
from jeat_graph.detection.models.layouts.yolox import is_raw
from jeat_graph.detection.models.onnx_head import Port

SIDE = (128, 96)
STRIDES = (8, 16, 32)
CLASSES = 4
CORNERS = np.array([[8.0, 16.0, 40.0, 48.0], [64.0, 32.0, 124.0, 92.0]])
SCORES = np.array([0.9, 0.6])
KINDS = np.array([2, 1])
#: Far below any threshold.
LOW = 1e-4


def recognise(outputs, side, notes):
    return recognise_network(Network(tuple(outputs), side, export_of(outputs, notes))).name


def logit(p):
    return np.log(p / (1 - p))


def grid():
    places, strides = cells(SIDE)
    return places, strides, (places + 0.5) * strides[:, None]


def at_cells(rows_per_cell=1):
    """Row of the cell nearest to each box's centre."""
    _, _, centres = grid()
    middle = (CORNERS[:, :2] + CORNERS[:, 2:]) / 2
    far = np.abs(centres[None] - middle[:, None]).sum(axis=2)
    return far.argmin(axis=1) * rows_per_cell


def sized(corners):
    return np.column_stack([(corners[:, :2] + corners[:, 2:]) / 2, corners[:, 2:] - corners[:, :2]])


def yolox(raw=False, per_cell=1):
    places, strides, centres = grid()
    n = len(places) * per_cell
    rows = np.zeros((n, 5 + CLASSES))
    rows[:, :2], rows[:, 2:4] = np.repeat(centres, per_cell, axis=0), 10.0
    rows[:, 4], rows[:, 5:] = LOW, LOW
    k = at_cells(per_cell)
    rows[k, :4], rows[k, 4] = sized(CORNERS), SCORES
    rows[k, 5 + KINDS] = 1.0
    if raw:
        rows[:, :2] = rows[:, :2] / strides[:, None] - places
        rows[:, 2:4] = np.log(rows[:, 2:4] / strides[:, None])
    return {"output": rows[None]}


def yolov8(transposed=False):
    rows = yolox()["output"][0]
    rows[:, 5:] *= rows[:, 4:5]
    rows = np.delete(rows, 4, axis=1)
    return {"output0": (rows if transposed else rows.T)[None]}


def end_to_end():
    rows = np.zeros((300, 6))
    rows[:2] = np.column_stack([CORNERS, SCORES, KINDS])
    return {"output0": rows[None]}


def detr(softmax=False):
    logits = np.full((50, CLASSES + softmax), -9.0)
    boxes = np.full((50, 4), 0.1)
    boxes[:2] = sized(CORNERS) / np.array([*SIDE, *SIDE])
    if softmax:
        logits[:] = np.log(LOW)
        logits[:, -1] = 0.0
        rest = np.log((1 - SCORES) / CLASSES)
        logits[:2] = rest[:, None]
        logits[[0, 1], KINDS] = np.log(SCORES)
    else:
        logits[[0, 1], KINDS] = logit(SCORES)
    return {"logits": logits[None], "pred_boxes": boxes[None]}


def boxes(shares=False):
    scale = np.array([*SIDE, *SIDE]) if shares else 1.0
    return {"labels": KINDS[None], "boxes": (CORNERS / scale)[None], "scores": SCORES[None]}


def nanodet():
    places, strides, centres = grid()
    classes = np.full((len(places), CLASSES), LOW)
    distances = np.zeros((len(places), 4, 8))
    distances[:, :, 0] = 20.0
    k = at_cells()
    classes[k, KINDS] = SCORES
    for row, corners in zip(k, CORNERS, strict=True):
        sides = (
            np.abs(np.concatenate([centres[row] - corners[:2], corners[2:] - centres[row]])) / strides[row]
        )
        for side, value in enumerate(sides):
            low = int(value)
            distances[row, side] = -40.0
            distances[row, side, low] = np.log(max(1 - (value - low), 1e-12))
            distances[row, side, low + 1] = np.log(max(value - low, 1e-12))
    distances = distances.reshape(len(places), -1)
    out, start = {}, 0
    for kind, array in (("cls_pred", classes), ("dis_pred", distances)):
        start = 0
        for stride in STRIDES:
            count = (SIDE[0] // stride) * (SIDE[1] // stride)
            out[f"{kind}_stride_{stride}"] = array[None, start : start + count]
            start += count
    return out


CASES = {
    "yolox": (yolox(), "yolox", {}),
    "yolox-raw": (yolox(raw=True), "yolox-raw", {}),
    "yolov5": (yolox(per_cell=3), "yolov5", {}),
    "yolov8": (yolov8(), "yolov8", {}),
    "yolov8 transposed": (yolov8(True), "yolov8", {"names": "{0: 'a', 1: 'b', 2: 'c', 3: 'd'}"}),
    "end-to-end": (end_to_end(), "end-to-end", {}),
    "detr": (detr(), "detr", {}),
    "boxes": (boxes(), "boxes", {}),
    "boxes in shares": (boxes(True), "boxes", {}),
    "nanodet": (nanodet(), "nanodet", {}),
}


def ports(outputs):
    return [Port(name, value.shape, "float32") for name, value in outputs.items()]


@pytest.mark.parametrize("case", CASES)
def test_a_layout_is_recognised_and_its_boxes_come_back(case):
    outputs, layout, notes = CASES[case]
    found = recognise(ports(outputs), SIDE, notes)
    if found == "yolox" and is_raw(outputs["output"][0], SIDE):
        found = "yolox-raw"
    assert found == layout
    check(decode(layout, outputs, SIDE))


def check(found):
    best = np.argsort(-found.scores)[:2]
    np.testing.assert_allclose(found.corners[best], CORNERS, atol=0.05)
    np.testing.assert_allclose(found.scores[best], SCORES, atol=1e-3)
    assert found.classes[best].tolist() == KINDS.tolist()


def test_detr_with_a_class_for_nothing_is_read_where_it_is_asked_for():
    check(decode("detr-softmax", detr(softmax=True), SIDE))
    coco = [Port("logits", (1, 100, 92), "float32"), Port("pred_boxes", (1, 100, 4), "float32")]
    assert recognise(coco, SIDE, {}) == "detr-softmax"


def test_published_shapes_are_recognised():
    def of(*shape):
        return recognise([Port("output", (1, *shape), "float32")], (640, 640), {})

    assert of(8400, 85) == "yolox"
    assert of(25200, 85) == "yolov5"
    assert of(84, 8400) == "yolov8"
    assert of(300, 6) == "end-to-end"
    assert of(8400, 112) == "nanodet"
    with pytest.raises(DataError, match="of no layout that is known: features"):
        recognise([Port("features", (1, 256, 20, 20), "float32")], (640, 640), {})


def test_outputs_of_another_layout_are_refused_with_their_shapes():
    with pytest.raises(
        DataError, match=r"outputs output0 \[1, 300, 6\] are not of the layout detr: they must be called"
    ):
        decode("detr", end_to_end(), SIDE)
