"""A network that gives NaN does not write a table without a word: few are counted, many are refused."""

from __future__ import annotations

import importlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.data.errors import DataError
from jeat_graph.detection.models.layouts.registry import all_layouts, decode
from jeat_graph.detection.models.model_settings import ModelSettings
from jeat_graph.detection.models.pictures import ModelPictureDetector
from jeat_graph.io.tables.detections_io import read_detections

pytest.importorskip("onnx", reason="pip install onnx")

from .tiny import constant_net

SIDE = (128, 96)
CELLS = 16 * 12 + 8 * 6 + 4 * 3  # of the strides 8, 16, 32
PICTURE = np.zeros((96, 128, 3), dtype=np.uint8)
ROWS = [[10, 20, 50, 60, 0.9, 0], [60, 20, 90, 60, 0.8, 0], [0, 0, 5, 5, 0.05, 0], [0, 0, 9, 9, 0.7, 0]]


def detector(tmp_path, rows):
    path = constant_net(
        tmp_path / "net.onnx", {"output0": np.array([rows])}, SIDE, notes={"names": "{0: 'car'}"}
    )
    return ModelPictureDetector(path, settings=ModelSettings(backend="opencv"))


@pytest.mark.parametrize("column", range(6))
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_box_without_numbers_is_left_out_and_counted(tmp_path, column, value):
    rows = [list(row) for row in ROWS]
    rows[1][column] = value
    model = detector(tmp_path, rows)
    for _ in range(3):
        np.testing.assert_allclose(np.sort(model(PICTURE, 0.0).scores), [0.7, 0.9], atol=1e-6)
    assert model.note().endswith(
        "net.onnx: 3 boxes had no numbers (NaN or infinite), in 3 of 3 scans: left out"
    )


def test_with_numbers_there_is_nothing_to_say(tmp_path):
    model = detector(tmp_path, ROWS)
    assert len(model(PICTURE, 0.0)) == 3
    assert model.note() == ""


def test_a_network_that_gives_mostly_none_is_refused(tmp_path):
    rows = [list(row) for row in ROWS]
    for row in rows[:3]:
        row[0] = np.nan
    model = detector(tmp_path, [*rows[:2], [np.nan] * 6, rows[3]])
    with pytest.raises(DataError, match=r"net\.onnx: the network gave no numbers .* for 3 of 4 boxes"):
        model(PICTURE, 0.0)


@pytest.mark.parametrize("share", [0.1, 1.0])
def test_the_command_says_it(tmp_path, capsys, share):
    frames = tmp_path / "frames"
    frames.mkdir()
    for k in range(4):
        cv2.imwrite(str(frames / f"{k}.png"), PICTURE)
    rows = np.tile(np.array(ROWS[3], dtype=float), (20, 1))
    rows[: int(20 * share), :4] = np.nan
    net = constant_net(tmp_path / "net.onnx", {"output0": rows[None]}, SIDE, notes={"names": "{0: 'car'}"})
    out = tmp_path / "d.csv"
    words = ["--frames", str(frames), "--rate", "20", "--detector-frames", str(net), "--out", str(out)]
    code = main(["detect", *words, "--detection-set", "model_frames.backend=opencv"])
    said = capsys.readouterr().err
    assert "Traceback" not in said
    if share == 1.0:
        assert code == 2
        assert not out.exists()
        assert "gave no numbers" in said
    else:
        assert code == 0
        assert "8 boxes had no numbers (NaN or infinite), in 4 of 4 scans: left out" in said
        assert np.isfinite(read_detections(out).boxes).all()


def outputs(layout: str, rng) -> dict[str, np.ndarray]:
    """Outputs of a layout with logits, so that what is no number could hide that they are logits."""
    logits = lambda *shape: rng.normal(-2.0, 3.0, shape)  # noqa: E731
    boxes = rng.uniform(0.2, 0.8, (1, 30, 4))
    centres = np.concatenate([rng.uniform(20, 80, (1, CELLS, 2)), rng.uniform(8, 30, (1, CELLS, 2))], axis=2)
    return {
        "yolox": lambda: {"o": np.concatenate([centres, logits(1, CELLS, 6)], axis=2)},
        "yolox-raw": lambda: {
            "o": np.concatenate([rng.uniform(0, 1, (1, CELLS, 4)), logits(1, CELLS, 6)], axis=2)
        },
        "yolov5": lambda: {"o": np.concatenate([centres, logits(1, CELLS, 6)], axis=2)},
        "yolov8": lambda: {"o": np.concatenate([centres, logits(1, CELLS, 5)], axis=2)},
        "yolov8-obb": lambda: {
            "o": np.concatenate([centres, logits(1, CELLS, 5), logits(1, CELLS, 1)], axis=2)
        },
        "end-to-end": lambda: {"o": np.array(ROWS * 3)[None]},
        "end-to-end-obb": lambda: {"o": np.array([[*row, 0.3] for row in ROWS * 3])[None]},
        "rtdetr": lambda: {"o": np.concatenate([boxes, logits(1, 30, 5)], axis=2)},
        "detr": lambda: {"logits": logits(1, 30, 5), "pred_boxes": boxes},
        "detr-softmax": lambda: {"logits": logits(1, 30, 5), "pred_boxes": boxes},
        "boxes": lambda: {
            "boxes": 60 * boxes,
            "scores": rng.uniform(0, 1, (1, 30)),
            "labels": np.zeros((1, 30)),
        },
        "nanodet": lambda: {"o": logits(1, CELLS, 5 + 4 * 8)},
    }[layout]()


def sample(layout: str) -> dict[str, np.ndarray]:
    """Outputs of a layout: of this file, or `SAMPLE` of the tests of the layout's own."""
    for path in sorted((Path(__file__).parent / "layouts").glob("test_*.py")):
        own = importlib.import_module(f"{__package__}.layouts.{path.stem}")
        if layout in getattr(own, "SAMPLE", {}):
            return own.SAMPLE[layout]
    return outputs(layout, np.random.default_rng(1))


@pytest.mark.parametrize("layout", all_layouts())
def test_one_row_without_numbers_changes_no_other(layout):
    given = sample(layout)
    whole = decode(layout, given, SIDE)
    changed = {name: array.copy() for name, array in given.items()}
    for array in changed.values():
        array[0, 7] = np.nan
    found = decode(layout, changed, SIDE)
    others = np.arange(len(whole.scores)) != 7
    np.testing.assert_array_equal(found.corners[others], whole.corners[others])
    np.testing.assert_array_equal(found.scores[others], whole.scores[others])
    assert not np.isfinite(found.scores[7]) or not np.isfinite(found.corners[7]).all()
