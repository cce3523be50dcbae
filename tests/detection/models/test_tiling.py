"""Pictures and cameras larger than the input in tiles: as if the network had seen them in one piece."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.detection.models import events as events_module
from jeat_graph.detection.models import pictures as pictures_module
from jeat_graph.detection.models.events import ModelEventDetector
from jeat_graph.detection.models.fused import FusedDetector
from jeat_graph.detection.models.layouts.record import DecodedBoxes
from jeat_graph.detection.models.model_settings import ModelSettings
from jeat_graph.detection.models.pictures import ModelPictureDetector
from jeat_graph.detection.models.tiling import Tiling, tiled_scale
from jeat_graph.detection.settings import EventSettings
from jeat_graph.io.events.evt3_writer import Evt3Writer

pytest.importorskip("onnx", reason="pip install onnx")

from .tiny import constant_net, counting_net, telling_net

SIDE, CAMERA = (256, 192), (640, 384)
OWN = {"card": "{}"}
FAST = EventSettings(rate_hz=50.0)
ALL = ModelSettings(tiles=0)
TILES = ModelSettings(tiles=0, backend="opencv")
#: Boxes that a network may give at once.
ROWS = np.zeros((40, 6))


class BlobEngine:
    """Finds what is lit, as a network would whose boxes are never wrong: one box a connected blob.

    Args:
        shown: name of the input.
        boxes: name of the output.
        wrong_px: standard deviation of the boxes' sides, if they are to be wrong.
    """

    name = "blobs"

    def __init__(self, shown: str, boxes: str, wrong_px: float = 0.0) -> None:
        self._shown, self._boxes, self._wrong_px = shown, boxes, wrong_px
        self._rng = np.random.default_rng(5)
        self.looks = 0

    def run(self, inputs):
        import cv2

        self.looks += 1
        lit = (inputs[self._shown][0].sum(axis=0) > 2.9).astype(np.uint8)
        found = cv2.connectedComponentsWithStats(lit)[2][1:, :4]
        rows = np.zeros((1, *ROWS.shape), np.float32)
        rows[0, : len(found), :2] = found[:, :2]
        rows[0, : len(found), 2:4] = found[:, :2] + found[:, 2:]
        rows[0, : len(found), :4] += self._rng.normal(0.0, self._wrong_px, (len(found), 4))
        rows[0, : len(found), 4:] = 0.9, 2.0  # a car
        return {self._boxes: rows, "state_next": np.zeros((1, 1, 1, 1), np.float32)}


def vehicles(seed: int, largest: tuple[int, int]) -> np.ndarray:
    """Boxes (M, 4) left, top, width, height at random places, none within 3 px of another."""
    rng, free, boxes = np.random.default_rng(seed), np.ones(CAMERA[::-1], bool), []
    for _ in range(60):
        width, height = rng.integers(5, largest[0]), rng.integers(5, largest[1])
        left, top = rng.integers(0, CAMERA[0] - width), rng.integers(0, CAMERA[1] - height)
        around = slice(max(top - 3, 0), top + height + 3), slice(max(left - 3, 0), left + width + 3)
        if free[around].all():
            free[around] = False
            boxes.append((left, top, width, height))
    return np.array(boxes)


def lit_by(boxes: np.ndarray) -> np.ndarray:
    lit = np.zeros(CAMERA[::-1], bool)
    for left, top, width, height in boxes.tolist():
        lit[top : top + height, left : left + width] = True
    return lit


def in_order(boxes: np.ndarray) -> np.ndarray:
    return boxes[np.lexsort(boxes.T.round(3))]


@pytest.mark.parametrize("largest", [(30, 22), (120, 90), (500, 300)])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_events_in_tiles_give_the_boxes_of_the_whole_picture(tmp_path, monkeypatch, seed, largest):
    """Small vehicles, such as are wider than what two tiles share, and such as are larger than a tile."""
    engine = BlobEngine("events", "found")
    monkeypatch.setattr(events_module, "open_engine", lambda *_: engine)
    expected = vehicles(seed, largest)
    y, x = np.nonzero(lit_by(expected))
    count = 3 * len(x)
    x, y = (np.tile(one, 3).astype("u2") for one in (x, y))
    lit = EventArray(np.sort(np.linspace(31_000, 70_000, count).astype(int)), x, y, np.ones(count, "u1"))
    late = EventArray(np.array([90_000]), *(np.zeros(1, kind) for kind in ("u2", "u2", "u1")))
    path = counting_net(tmp_path / "net.onnx", SIDE, 20, ROWS)
    # Not of `train`: shown at the camera's own size, so that boxes are exact.
    detector = ModelEventDetector(path, CAMERA, times=FAST, settings=TILES)
    assert "in 256 x 192 px, 9 tiles" in detector.description
    scan = [*detector.push(lit), *detector.push(late)][0]
    assert engine.looks == 9
    np.testing.assert_allclose(in_order(scan.boxes), in_order(expected), atol=1e-3)


@pytest.mark.parametrize("seed", [1, 2])
def test_pictures_in_tiles_give_the_boxes_of_the_whole_picture(tmp_path, monkeypatch, seed):
    engine = BlobEngine("images", "output0")
    monkeypatch.setattr(pictures_module, "open_engine", lambda *_: engine)
    expected = vehicles(seed, (120, 90))
    frame = np.repeat(255 * lit_by(expected).astype(np.uint8)[..., None], 3, axis=2)
    path = constant_net(tmp_path / "net.onnx", {"output0": ROWS[None]}, SIDE)
    scan = ModelPictureDetector(path, settings=TILES)(frame, 0.0)
    np.testing.assert_allclose(in_order(scan.boxes), in_order(expected), atol=1e-3)
    engine.looks = 0
    ModelPictureDetector(path, settings=ModelSettings(tiles=2))(frame, 0.0)
    assert engine.looks == 2
    ModelPictureDetector(path)(frame, 0.0)
    assert engine.looks == 3


@pytest.mark.parametrize("seed", range(6))
def test_a_vehicle_has_one_box_where_boxes_are_wrong(seed):
    """Sides wrong by 1.5 px (standard deviation), differently in each tile."""
    tiling, expected = Tiling(CAMERA, SIDE), vehicles(seed, (160, 110))
    engine = BlobEngine("shown", "found", wrong_px=1.5)
    found = []
    for tile in tiling.cut(3.0 * lit_by(expected)[None, None]):
        rows = engine.run({"shown": tile})["found"][0]
        rows = rows[rows[:, 4] > 0].astype(float)
        found.append(DecodedBoxes(rows[:, :4], rows[:, 4], rows[:, 5].astype(int), distinct=False))
    corners = tiling.together(found, 0.55).corners
    middles = (corners[:, :2] + corners[:, 2:]) / 2.0
    offs = np.abs(middles[:, None] - (expected[:, :2] + expected[:, 2:] / 2.0)[None]).max(axis=2)
    assert (offs.min(axis=1) < 6.0).all()  # a box is of some vehicle
    assert (offs.min(axis=0) < 6.0).all()  # and each has one
    # Two at most, which the suppression that follows makes one: both tiles see it equally well.
    assert len(corners) <= 1.4 * len(expected)


@pytest.mark.parametrize(
    "length", [(640, 384), (257, 192), (1000, 192), (256, 193), (4000, 3000), (100, 700)]
)
def test_tiles_cover_the_canvas_and_share_an_eighth(length):
    tiling = Tiling(length, SIDE)
    width, height = tiling.canvas_px
    covered = np.zeros((height, width), bool)
    for left, top, right, bottom in tiling.places.tolist():
        assert (right - left, bottom - top) == SIDE
        covered[top:bottom, left:right] = True
    assert covered.all()
    for first, last, side in ((0, 2, SIDE[0]), (1, 3, SIDE[1])):
        spans = sorted({(row[first], row[last]) for row in tiling.places.tolist()})
        assert all(one[1] - other[0] >= side / 8 - 1 for one, other in pairwise(spans))


@pytest.mark.parametrize(
    ("most", "own", "scale", "tiles"),
    [
        # Two columns of 960 px that share 120 reach over 1800 px, two rows of 576 that share 72 over 1080.
        (0, True, 1800 / 1280, 4),
        (4, True, 1800 / 1280, 4),
        (0, False, 1.0, 4),
        (3, True, 0.8, 2),  # 576 px high
        (2, False, 0.8, 2),
        (20, True, 1.5, 6),  # never larger than in training
        (20, False, 1.0, 4),
    ],
)
def test_as_many_tiles_as_are_allowed_show_the_camera_largest(most, own, scale, tiles):
    camera, side = (1280, 720), (960, 576)
    assert tiled_scale(camera, side, most, own=own) == pytest.approx(scale)
    assert len(Tiling((round(1280 * scale), round(720 * scale)), side)) == tiles


def test_boxes_come_back_where_tiles_have_room_to_enlarge_the_camera(tmp_path):
    """Two columns of 128 px that share 16 reach over 240, two rows of 96 over 180 px: 240 / 180."""
    box = np.array([[10.0, 20.0, 30.0, 40.0, 0.9, 2.0]])
    path = counting_net(tmp_path / "rnn.onnx", (128, 96), 20, box, per_event=1.0, notes=OWN)
    detector = ModelEventDetector(path, (180, 130), times=FAST, settings=TILES)
    assert " at 1.33 times the camera's, 4 tiles" in detector.description
    # One event in the middle of the picture, which all tiles see: pixel 119 of 240, and 87 of 173.
    at = np.array([21_000, 41_000, 90_000])
    x, y = np.array([5, 89, 5], "u2"), np.array([5, 65, 5], "u2")
    scan = detector.push(EventArray(at, x, y, np.ones(3, "u1")))[0]
    lefts, tops = np.array([0, 112]) + 10 + 8 * (1 + 1), np.array([0, 173 - 96]) + 20
    expected = np.array([(left, top, 20, 20) for left in lefts for top in tops]) * 180 / 240
    np.testing.assert_allclose(in_order(scan.boxes), in_order(expected), atol=1e-3)


def test_each_tile_has_its_own_memory(tmp_path):
    """The network counts windows and events in its state, and moves its box right by 8 px for each."""
    box = np.array([[10.0, 20.0, 30.0, 40.0, 0.9, 2.0]])
    path = counting_net(tmp_path / "rnn.onnx", (128, 96), 20, box, per_event=1.0, notes=OWN)
    detector = ModelEventDetector(path, (240, 96), times=FAST, settings=TILES)
    assert ", 2 tiles, 1 states kept" in detector.description
    # Three events at the left, one at the right; the last one lies behind the first full window.
    x = np.array([5, 6, 7, 200, 5], "u2")
    times = np.array([21_000, 41_000, 42_000, 43_000, 90_000])
    scan = detector.push(EventArray(times, x, np.full(5, 50, "u2"), np.ones(5, "u1")))[0]
    expected = [10 + 8 * (1 + 2), 112 + 10 + 8 * (1 + 1)]
    np.testing.assert_allclose(np.sort(scan.boxes[:, 0]), expected, atol=1e-3)


def test_a_network_of_both_sees_the_same_tile_of_both(tmp_path):
    """Its box lies 24 px to the right with both sensors, and lower by the mean of the picture (px)."""
    pytest.importorskip("onnxruntime", reason="pip install 'onnxruntime>=1.20,<2'")
    box = np.array([[10.0, 20.0, 30.0, 40.0, 0.9, 0.0]])
    path = telling_net(tmp_path / "both.onnx", (128, 96), 20, box, OWN)
    frame = np.zeros((96, 240, 3), np.uint8)
    frame[:, 128:] = 255
    detector = FusedDetector(path, (240, 96), times=FAST, settings=ALL, pictures=[(0.05, frame)])
    at = np.array([21_000, 41_000, 90_000])
    scan = detector.push(EventArray(at, np.full(3, 9, "u2"), np.full(3, 9, "u2"), np.ones(3, "u1")))[0]
    boxes = scan.boxes[np.argsort(scan.boxes[:, 0])]
    np.testing.assert_allclose(boxes[:, 0], [10 + 24, 112 + 10 + 24], atol=1e-3)
    age_px = boxes[0, 1] - 20.0
    # Of the second tile, from column 112 on, an eighth is dark.
    assert boxes[1, 1] == pytest.approx(20.0 + age_px + 0.875, abs=1e-3)


def test_who_is_shown_less_is_told_so_in_one_line(tmp_path, capsys):
    box = np.array([[10.0, 20.0, 30.0, 40.0, 0.9, 2.0]])
    path = counting_net(tmp_path / "rnn.onnx", (128, 96), 20, box, notes=OWN)
    with Evt3Writer(tmp_path / "e.raw", (240, 96)) as writer:
        at = np.arange(20_000, 300_000, 1000)
        writer.append(EventArray(at, *(np.full(len(at), 9, "u2"),) * 2, np.ones(len(at), "u1")))
    words = ["detect", "--events", str(tmp_path / "e.raw"), "--detector-events", str(path)]
    words += ["--out", str(tmp_path / "d.csv")]
    told = "rnn.onnx is shown the camera at 0.533 of its size; model_events.tiles=0"
    assert main(words) == 0
    assert told in capsys.readouterr().err
    assert main([*words, "--detection-set", "model_events.tiles=0"]) == 0
    assert "model_events.tiles" not in capsys.readouterr().err


def test_a_network_of_others_sees_a_larger_camera_in_tiles_only(tmp_path):
    box = np.array([[10.0, 20.0, 30.0, 40.0, 0.9, 2.0]])
    path = counting_net(tmp_path / "rvt.onnx", (128, 96), 20, box)
    with pytest.raises(DataError, match=r"takes windows of 128 x 96 px; the camera has 240 x 96: .*2 tiles"):
        ModelEventDetector(path, (240, 96), times=FAST)
    assert ", 2 tiles" in ModelEventDetector(path, (240, 96), times=FAST, settings=TILES).description
