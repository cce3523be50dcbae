"""Exports of any version are read as what they are: notes first, then the shapes at run time, then names."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.errors import DataError
from jeat_graph.detection.models.model_settings import ModelSettings
from jeat_graph.detection.models.pictures import ModelPictureDetector

pytest.importorskip("onnx", reason="pip install onnx")

from .exported import CORNERS, SCORES, Made, notes_of, write

BACKENDS = ("opencv", "onnxruntime")


@st.composite
def exports(draw):
    """A network as some version writes it."""
    family = draw(st.sampled_from(["v5", "v8", "v8", "e2e", "e2e"]))
    task = (
        "detect" if family == "v5" else draw(st.sampled_from(["detect", "detect", "segment", "pose", "obb"]))
    )
    side = draw(st.sampled_from([(320, 320), (256, 256), (320, 224), (640, 640)]))
    few = [1, 2, 3, 4] if side == (640, 640) else [1, 2, 3, 4, 80]
    classes = 1 if task == "pose" else draw(st.sampled_from(few))
    made = Made(
        family, task, side, classes, draw(st.booleans()), draw(st.booleans()), draw(st.integers(12, 20)), {}
    )
    suppressed = family == "e2e"
    by_nms = suppressed and draw(st.booleans())
    late = draw(st.booleans())
    end_to_end = (suppressed and not by_nms) if late else None
    # A file that leaves its input open says how large it was made for, or is of 640 px, or one can tell.
    imgsz = side[0] != side[1] or (suppressed and side != (640, 640)) or draw(st.booleans())
    if family == "v5" and side[0] != side[1]:
        made = made._replace(dynamic=False)
    said = notes_of(
        made, nms=by_nms, end_to_end=end_to_end, arguments=by_nms or draw(st.booleans()), imgsz=imgsz
    )
    return made._replace(notes=said)


def expected(made):
    """The layout, for the description."""
    name = {"v5": "yolov5", "v8": "yolov8", "e2e": "end-to-end"}[made.family]
    return f"layout {name}{'-obb' if made.task == 'obb' else ''},"


@given(made=exports(), backend=st.sampled_from(BACKENDS))
def test_the_two_boxes_come_back(tmp_path_factory, made, backend):
    if backend == "onnxruntime":
        pytest.importorskip("onnxruntime", reason="pip install onnxruntime")
    path = write(tmp_path_factory.getbasetemp() / "drawn.onnx", made)
    reading = ModelSettings(backend=backend, fit="letterbox", classes=("all",))
    detector = ModelPictureDetector(path, settings=reading)
    assert expected(made) in detector.description
    width, height = made.side
    scan = detector(np.zeros((height, width, 3), np.uint8), 0.0)
    np.testing.assert_allclose(
        scan.boxes, np.column_stack([CORNERS[:, :2], CORNERS[:, 2:] - CORNERS[:, :2]]), atol=0.07
    )
    np.testing.assert_allclose(scan.scores, SCORES, atol=1e-3)
    assert scan.classes.tolist() == [f"kind {k}" for k in made.kinds]


BASE = Made("v8", "detect", (320, 320), 2, dynamic=False, half=False, opset=13, notes={})
NOTES = {"task": "detect", "names": "{0: 'car', 1: 'bus'}"}


@pytest.mark.parametrize(
    ("family", "said", "reading", "words"),
    [
        (
            "v8",
            {"args": "{'nms': True}"},
            {},
            r"output0 \[1, 6, 2100\]; its notes say .*suppression by itself",
        ),
        ("v8", {"end2end": "True"}, {}, "of no layout that is known"),
        ("e2e", {"args": "{'nms': False}", "end2end": "False"}, {}, "no suppression by itself"),
        ("e2e", {"task": "obb"}, {}, "its notes say task obb"),
        ("v8", {}, {"layout": "yolov5"}, "cannot be of the layout yolov5: its outputs are output0"),
        ("e2e", {"end2end": "True"}, {"layout": "yolov8"}, "cannot be of the layout yolov8"),
        ("v8", {"names": "{0: 'car'}"}, {}, "has 6 numbers a row and names 1 classes"),
    ],
)
def test_a_layout_that_contradicts_notes_or_shapes_is_refused(tmp_path, family, said, reading, words):
    made = BASE._replace(family=family, notes={**NOTES, **said})
    path = write(tmp_path / "net.onnx", made)
    with pytest.raises(DataError, match=words) as error:
        ModelPictureDetector(path, settings=ModelSettings(backend="opencv", **reading))
    assert "net.onnx" in str(error.value)


def test_a_file_that_declares_another_layout_than_it_gives_is_refused(tmp_path):
    path = write(tmp_path / "net.onnx", BASE._replace(notes=NOTES), declared={"output0": [1, 300, 6]})
    detector = ModelPictureDetector(path, settings=ModelSettings(backend="opencv"))
    with pytest.raises(
        DataError, match=r"net\.onnx: declares outputs of the layout end-to-end and gives such"
    ):
        detector(np.zeros((320, 320, 3), np.uint8), 0.0)


def test_the_user_says_the_size_of_an_open_input_where_the_notes_say_another(tmp_path):
    said = {**NOTES, "imgsz": "[640, 640]"}
    path = write(tmp_path / "net.onnx", BASE._replace(dynamic=True, notes=said))
    reading = ModelSettings(backend="opencv", width=320, height=320)
    assert "input 320 x 320 px" in ModelPictureDetector(path, settings=reading).description
