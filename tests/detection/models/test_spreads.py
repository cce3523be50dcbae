"""Networks that say how far off each side of a box may be: what they say stays with the box, in its px."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.detection.models.layouts.record import DecodedBoxes
from jeat_graph.detection.models.model_settings import ModelSettings
from jeat_graph.detection.models.pictures import ModelPictureDetector
from jeat_graph.detection.models.tiling import Tiling
from jeat_graph.io.tables.detections_io import read_detections

pytest.importorskip("onnx", reason="pip install onnx")

from .tiny import constant_net

SIDE = (128, 96)
#: Cells of strides 8, 16 and 32 px.
CELLS = 16 * 12 + 8 * 6 + 4 * 3
OPENCV = ModelSettings(backend="opencv")


def outputs(spread_of_first):
    """Of all cells two have a box, in the layout of YOLOv8; middle, size, score."""
    boxes = np.zeros((1, 5, CELLS))
    boxes[0, :, 3], boxes[0, :, 90] = (30, 40, 40, 40, 0.9), (90, 60, 20, 10, 0.8)
    spreads = np.ones((1, 4, CELLS))
    spreads[0, :, 3], spreads[0, :, 90] = spread_of_first, (1, 2, 3, 4)
    return {"boxes": boxes, "spreads": spreads}


def test_they_are_of_the_picture_and_of_their_box(tmp_path):
    path = constant_net(tmp_path / "net.onnx", outputs((4, 3, 2, 1)), SIDE)
    detector = ModelPictureDetector(path, settings=OPENCV)
    assert "layout yolov8" in detector.description
    scan = detector(np.zeros((48, 256, 3), dtype=np.uint8), 0.0)  # at half of its size
    np.testing.assert_allclose(scan.box_std, [[8, 6, 4, 2], [2, 4, 6, 8]], rtol=1e-6)


def test_they_are_in_the_file_of_detections(tmp_path):
    import cv2

    path = constant_net(tmp_path / "net.onnx", outputs((4, 3, 2, 1)), SIDE)
    (tmp_path / "frames").mkdir()
    for k in range(2):
        cv2.imwrite(str(tmp_path / "frames" / f"{k}.png"), np.zeros((96, 128, 3), dtype=np.uint8))
    out = tmp_path / "found.csv"
    options = ["--rate", "10", "--detector-frames", str(path)]
    options += ["--detection-set", "model_frames.backend=opencv"]
    assert main(["detect", "--frames", str(tmp_path / "frames"), *options, "--out", str(out)]) == 0
    expected = [[4, 3, 2, 1], [1, 2, 3, 4]]
    np.testing.assert_allclose(read_detections(out).box_std, np.tile(expected, (2, 1)), rtol=1e-6)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -1.0])
def test_a_box_with_a_spread_that_is_none_is_left_out_and_counted(tmp_path, wrong):
    path = constant_net(tmp_path / "net.onnx", outputs((4, wrong, 2, 1)), SIDE)
    detector = ModelPictureDetector(path, settings=OPENCV)
    scan = detector(np.zeros((96, 128, 3), dtype=np.uint8), 0.0)
    np.testing.assert_allclose(scan.box_std, [[1, 2, 3, 4]], rtol=1e-6)
    assert "1 boxes had no numbers" in detector.note()


def test_of_parts_in_two_tiles_each_side_keeps_that_of_the_part_that_shows_it():
    tiling = Tiling((448, 96), (256, 96))
    (first, second) = tiling.places.tolist()
    vehicle = [150.0, 20, 330, 60]  # no tile sees all of it
    assert vehicle[0] < second[0]
    assert vehicle[2] > first[2]
    parts = [
        [[vehicle[0], 20, 256, 60]],
        [[0, 20, vehicle[2] - second[0], 60]],
    ]
    found = [
        DecodedBoxes(np.array(part), np.array([score]), np.array([2]), False, np.array([spreads]))
        for part, score, spreads in zip(parts, (0.9, 0.8), ((1.0, 2, 3, 4), (5.0, 6, 7, 8)), strict=True)
    ]
    joined = tiling.together(found, 0.55)
    np.testing.assert_allclose(joined.corners, [vehicle])
    assert joined.spreads is not None
    assert joined.spreads[0, 0] == 1.0
    assert joined.spreads[0, 2] == 7.0
