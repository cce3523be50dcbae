"""Exports as people have them: one car is one box of class car in its place, or the file is refused by name.

The picture has 1280 x 720 px; the car lies at left 600, top 300 and is 80 wide and 60 high.
"""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.detection.models.class_names import COCO, class_names, known_names
from jeat_graph.detection.models.model_settings import ModelSettings
from jeat_graph.detection.models.pictures import ModelPictureDetector

pytest.importorskip("onnx", reason="pip install onnx")

from .tiny import constant_net

SIDE = (640, 640)
CELLS = 8400
CAR = 2
CAR_PX = [600.0, 300.0, 80.0, 60.0]
PICTURE = np.zeros((720, 1280, 3), dtype=np.uint8)
# In the letterbox: half the size, 140 px below the edge.
CENTRE = [320.0, 305.0, 40.0, 30.0]
CORNERS = [300.0, 290.0, 340.0, 320.0]
# Stretched, as shares of the picture.
SHARES = [0.5, 330 / 720, 80 / 1280, 60 / 720]
NAMES = dict(enumerate(COCO))


def dense(channels, *, classes=80, behind=None, kind=CAR):
    """[1, channels, cells] with one car; `behind` fills what stands behind the classes."""
    table = np.zeros((1, channels, CELLS))
    table[0, :4] = np.array([10, 10, 5, 5])[:, None]
    if behind is not None:
        table[0, 4 + classes :] = behind
    table[0, :4, 4000] = CENTRE
    table[0, 4 + kind, 4000] = 0.9
    return table


def few(row, columns, count=300):
    table = np.zeros((1, count, columns))
    table[0, 0, : len(row)] = row
    return table


def notes(task, names=NAMES, **more):
    return {key: str(value) for key, value in {"task": task, "names": names, **more}.items()}


RNG = np.random.default_rng(0)
PROTO = np.zeros((1, 32, 160, 160))
POINTS = RNG.uniform(0, 640, (51, CELLS))
EXPORTS = {
    "detect": ({"output0": dense(84)}, notes("detect"), "yolov8"),
    "detect, names as a list": ({"output0": dense(84)}, notes("detect", COCO), "yolov8"),
    "segment": (
        {"output0": dense(116, behind=RNG.normal(0, 1, (32, CELLS))), "output1": PROTO},
        notes("segment"),
        "yolov8 ",
    ),
    "segment without notes": (
        {"output0": dense(116, behind=RNG.normal(0, 1, (32, CELLS))), "output1": PROTO},
        {},
        "yolov8 ",
    ),
    "segment, suppressed": (
        {"output0": few([*CORNERS, 0.9, CAR], 38), "output1": PROTO},
        notes("segment"),
        "end-to-end ",
    ),
    "suppressed": ({"output0": few([*CORNERS, 0.9, CAR], 6)}, notes("detect"), "end-to-end"),
    "turned": ({"output0": dense(85, behind=0.0)}, notes("obb"), "yolov8-obb"),
    "turned, suppressed": (
        {"output0": few([*CENTRE, 0.9, CAR, 0.0], 7)},
        notes("obb"),
        "end-to-end-obb",
    ),
    "RT-DETR by its head": (
        {"output0": few([*SHARES, 0.9, CAR], 6)},
        notes("detect", head="RTDETRDecoder"),
        "rtdetr",
    ),
    "RT-DETR by its description": (
        {"output0": few([*SHARES, *(0.9 * (np.arange(80) == CAR))], 84)},
        notes("detect", description="Ultralytics RT-DETR-l model"),
        "rtdetr",
    ),
    "half precision": ({"output0": dense(84)}, notes("detect"), "yolov8"),
}


@pytest.mark.parametrize("case", EXPORTS)
def test_one_car_is_one_box_of_its_class(tmp_path, case):
    outputs, said, layout = EXPORTS[case]
    path = constant_net(tmp_path / "net.onnx", outputs, SIDE, notes=said)
    detector = ModelPictureDetector(path, settings=ModelSettings(backend="opencv"))
    assert f"layout {layout}".strip() in detector.description
    scan = detector(PICTURE, 0.0)
    np.testing.assert_allclose(scan.boxes, [CAR_PX], atol=0.1)
    np.testing.assert_allclose(scan.scores, [0.9], atol=1e-6)
    assert scan.classes.tolist() == ["car"]


def test_people_of_a_pose_export_are_boxes_where_they_are_asked_for(tmp_path):
    said = notes("pose", {0: "person"}, kpt_shape=[17, 3])
    outputs = {"output0": dense(56, classes=1, behind=POINTS, kind=0)}
    path = constant_net(tmp_path / "pose.onnx", outputs, SIDE, notes=said)
    detector = ModelPictureDetector(path, settings=ModelSettings(backend="opencv"))
    assert "boxes of poses" in detector.description
    scan = detector(PICTURE, 0.0)
    np.testing.assert_allclose(scan.boxes, [CAR_PX], atol=0.1)
    assert scan.classes.tolist() == ["person"]


def test_a_turned_box_is_the_upright_one_around_it(tmp_path):
    """40 x 30 px turned by 90 degrees are 30 x 40: 60 x 80 in the picture about the same centre."""
    path = constant_net(
        tmp_path / "net.onnx", {"output0": dense(85, behind=np.pi / 2)}, SIDE, notes=notes("obb")
    )
    scan = ModelPictureDetector(path, settings=ModelSettings(backend="opencv"))(PICTURE, 0.0)
    np.testing.assert_allclose(scan.boxes, [[610, 290, 60, 80]], atol=0.1)


@pytest.mark.parametrize(
    ("outputs", "said", "words"),
    [
        ({"output0": dense(56, classes=1, behind=POINTS, kind=0)}, {}, "has 56 numbers a row and no notes"),
        ({"output0": dense(56)}, notes("detect", {0: "person"}), "names 1 classes: not what an export of"),
        ({"output0": np.zeros((1, 1000))}, notes("classify"), "the task 'classify', which gives no boxes"),
        ({"output0": np.zeros((1, 300, 84))}, {}, "outputs of no layout that is known"),
    ],
)
def test_what_gives_no_boxes_is_refused_by_name(tmp_path, outputs, said, words):
    path = constant_net(tmp_path / "net.onnx", outputs, SIDE, notes=said)
    with pytest.raises(DataError, match=words) as error:
        ModelPictureDetector(path)
    assert "net.onnx" in str(error.value)


def test_shares_of_a_picture_are_not_taken_for_pixels(tmp_path):
    path = constant_net(tmp_path / "net.onnx", {"output0": few([*SHARES, 0.9, CAR], 6)}, SIDE)
    with pytest.raises(DataError, match=r"net\.onnx.*shares of the picture.*say layout: rtdetr"):
        ModelPictureDetector(path, settings=ModelSettings(backend="opencv"))(PICTURE, 0.0)
    settings = ModelSettings(backend="opencv", layout="rtdetr")
    np.testing.assert_allclose(
        ModelPictureDetector(path, settings=settings)(PICTURE, 0.0).boxes, [CAR_PX], atol=0.1
    )


def test_fifty_two_classes_without_names_are_read_where_the_layout_is_said(tmp_path):
    path = constant_net(tmp_path / "net.onnx", {"output0": dense(56)}, SIDE)
    scan = ModelPictureDetector(path, settings=ModelSettings(layout="yolov8", backend="opencv"))(PICTURE, 0.0)
    np.testing.assert_allclose(scan.boxes, [CAR_PX], atol=0.1)
    assert scan.classes.tolist() == ["2"]


def test_a_file_for_several_pictures_at_once_says_what_to_do(tmp_path):
    path = constant_net(tmp_path / "net.onnx", {"output0": dense(84)}, SIDE, batch=4)
    with pytest.raises(DataError, match=r"net\.onnx: takes 4 pictures at once; export it for one"):
        ModelPictureDetector(path)


def test_one_class_without_a_name_has_none(tmp_path):
    rows = np.zeros((1, 3549, 6))
    rows[..., :4] = [5, 5, 2, 2]
    rows[0, 100] = [208, 330 * 0.325, 26, 19.5, 0.95, 0.95]
    path = constant_net(tmp_path / "one.onnx", {"output": rows}, (416, 416))
    scan = ModelPictureDetector(path, settings=ModelSettings(backend="opencv"))(PICTURE, 0.0)
    np.testing.assert_allclose(scan.boxes, [CAR_PX], atol=0.1)
    assert scan.classes is None


def test_one_class_that_is_any_vehicle_says_nothing_and_a_car_does(tmp_path):
    rows = {"output0": few([*CORNERS, 0.9, 0], 6)}
    for name, classes in (("vehicle", None), ("car", ["car"])):
        path = constant_net(tmp_path / "net.onnx", rows, SIDE, notes=notes("detect", {0: name}))
        scan = ModelPictureDetector(path, settings=ModelSettings(backend="opencv"))(PICTURE, 0.0)
        assert (None if scan.classes is None else scan.classes.tolist()) == classes


def test_scores_for_each_class_beside_boxes_are_read(tmp_path):
    """YOLO-NAS and others: boxes [1, N, 4] and scores [1, N, C] that nobody has suppressed."""
    corners = np.zeros((1, 40, 4))
    corners[0, :2] = [CORNERS, np.add(CORNERS, 1.0)]
    scores = np.zeros((1, 40, 80))
    scores[0, :2, CAR] = [0.9, 0.8]
    path = constant_net(tmp_path / "net.onnx", {"boxes": corners, "scores": scores}, SIDE)
    settings = ModelSettings(backend="opencv", fit="letterbox-centre")
    scan = ModelPictureDetector(path, settings=settings)(PICTURE, 0.0)
    np.testing.assert_allclose(scan.boxes, [CAR_PX], atol=0.1)
    assert scan.classes.tolist() == ["car"]


def test_names_of_coco_follow_from_the_number_of_classes():
    assert known_names({}, 80)[7] == "truck"
    assert known_names({}, 91)[8] == "truck"
    assert known_names({}, 91)[90] == "toothbrush"
    assert known_names({}, 3) == {}
    assert class_names({"names": "['car', 'bus']"}) == {0: "car", 1: "bus"}
    assert class_names({"names": "nonsense ("}) == {}


def test_a_number_that_no_class_has_is_refused(tmp_path):
    path = constant_net(tmp_path / "net.onnx", {"output0": dense(84)}, SIDE)
    with pytest.raises(ConfigError, match="classes: '80' is none of the network's"):
        ModelPictureDetector(path, settings=ModelSettings(classes=("80",)))
