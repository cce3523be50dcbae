"""What finds vehicles where nobody says: no network that contradicts what moves, or is unsure."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest

from jeat_graph.cli.main import main
from jeat_graph.detection import network_cache
from jeat_graph.detection.automatic import Impression, choose_among, resolved
from jeat_graph.detection.kept_choice import keep_choice, kept_choice
from jeat_graph.detection.known_networks import KNOWN
from jeat_graph.detection.named import AUTO
from jeat_graph.detection.request import DetectRequest
from jeat_graph.detection.settings import DetectionSettings, load_settings

DATA = Path(__file__).parents[3] / "shared" / "data"


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A cache of one's own, without networks."""
    folder = tmp_path / "networks"
    folder.mkdir()
    monkeypatch.setenv(network_cache.FOLDER, str(folder))
    monkeypatch.setattr(network_cache, "is_private", lambda _: True)
    monkeypatch.setenv(network_cache.MIRROR, "http://127.0.0.1:9")  # nothing is fetched
    monkeypatch.setitem(KNOWN, "yolox-tiny", KNOWN["yolox-tiny"]._replace(sha256=()))  # any file is it
    return folder


def impression(name="yolox-s", boxes=2.0, sound=0.9, seen=0.5, accuracy=40.5, **more):
    return Impression(name, boxes, sound, seen, accuracy, **more)


#: One that knows no classes, as `sehn` is.
NO_CLASSES = {"name": "sehn", "accuracy": 0.0, "classes": False}


@pytest.mark.parametrize(
    ("found", "moves", "chosen"),
    [
        ([], True, "motion"),
        ([impression()], True, "yolox-s"),
        ([impression(sound=0.4)], True, "motion"),  # boxes that are still and unsure
        ([impression(seen=0.05)], True, "motion"),  # sees nothing of what moves
        ([impression(boxes=0.0, sound=0.0, seen=0.0)], True, "motion"),
        ([impression(boxes=0.0, sound=0.0, seen=1.0)], False, "yolox-s"),  # an empty road
        ([impression("sehn", boxes=0.0, sound=0.0, accuracy=0.0)], False, "motion"),
        ([impression(), impression("sehn", boxes=6.0, accuracy=0.0)], True, "sehn"),  # a highway
        ([impression(), impression("sehn", boxes=6.0, sound=0.3, accuracy=0.0)], True, "yolox-s"),
        ([impression("yolox-nano", 2.4, accuracy=25.8), impression("yolox-s", 2.1)], True, "yolox-s"),
        # A gantry: four ghosts that stand, and no classes.
        ([impression(boxes=5.0), impression(boxes=9.0, moving=5 / 9, **NO_CLASSES)], True, "yolox-s"),
        ([impression(boxes=5.0), impression(boxes=6.0, **NO_CLASSES)], True, "yolox-s"),
        ([impression(boxes=2.0), impression(boxes=6.0, **NO_CLASSES)], True, "sehn"),
    ],
)
def test_the_one_that_sees_most_of_those_that_are_sound_is_taken(found, moves, chosen):
    assert choose_among(found, moves) == chosen


def pictures(folder, boxes=None):
    """A folder of pictures in which a dark block moves, if `boxes`."""
    rng = np.random.default_rng(0)
    street = rng.normal(110, 2, (96, 128, 3)).clip(0, 255).astype(np.uint8)
    folder.mkdir()
    for k in range(30):
        picture = street.copy()
        if boxes:
            picture[40:60, 10 + 2 * k : 40 + 2 * k] = 20
        cv2.imwrite(str(folder / f"{k:03d}.png"), picture)
    return folder


def net(path, rows):
    from .models.tiny import constant_net

    names = {0: "person", 2: "car"}
    return constant_net(path, {"output0": np.array([rows])}, (128, 96), notes={"names": str(names)})


def test_a_network_of_the_cache_that_sees_what_moves_is_taken(folder, tmp_path, capsys):
    pytest.importorskip("onnx", reason="pip install onnx")
    net(folder / "yolox_tiny.onnx", [[10, 40, 100, 60, 0.9, 2]])
    frames = pictures(tmp_path / "frames", boxes=True)
    words = ["--frames", str(frames), "--rate", "10", "--out", str(tmp_path / "out.csv")]
    assert main(["detect", *words]) == 0
    said = capsys.readouterr().err
    assert "detector: yolox-tiny, by the first 3 s (yolox-tiny 1.0 boxes a picture, 100 % sound" in said
    assert "--detector-frames NAME takes another" in said
    assert set(pd.read_csv(tmp_path / "out.csv")["class"]) == {"car"}


def test_a_run_says_what_made_its_detections(folder, tmp_path):
    frames = pictures(tmp_path / "frames", boxes=True)
    words = ["--frames", str(frames), "--rate", "10", "--out", str(tmp_path / "run")]
    assert main(["track", *words]) == 0
    record = json.loads((tmp_path / "run" / "run.json").read_text())
    assert record["detectors"] == ["rgb: motion"] or record["detectors"] == ["rgb: sehn"]


def test_one_with_still_and_unsure_boxes_is_not(folder, tmp_path):
    pytest.importorskip("onnx", reason="pip install onnx")
    net(folder / "yolox_tiny.onnx", [[0, 0, 20, 20, 0.46, 2], [100, 70, 120, 90, 0.48, 2]])
    frames = pictures(tmp_path / "frames", boxes=True)
    asked = DetectRequest(frames=frames, rate_hz=10.0, detector_frames=AUTO)
    said: list[str] = []
    assert resolved(asked, said.append).detector_frames == "motion"
    assert "0 % sound" in said[-2]
    assert "be it a vehicle or not" in said[-1]


def test_boxes_that_are_more_likely_false_do_not_count_for_it(folder, tmp_path):
    pytest.importorskip("onnx", reason="pip install onnx")
    net(folder / "yolox_tiny.onnx", [[10, 40, 100, 60, 0.9, 2], [0, 0, 20, 20, 0.4, 2]])
    frames = pictures(tmp_path / "frames", boxes=True)
    asked = DetectRequest(frames=frames, rate_hz=10.0, detector_frames=AUTO)
    said: list[str] = []
    assert resolved(asked, said.append).detector_frames == "yolox-tiny"
    assert "yolox-tiny 1.0 boxes a picture, 100 % sound" in said[-1]


def test_one_that_does_not_work_is_passed_over(folder, tmp_path):
    pytest.importorskip("onnx", reason="pip install onnx")
    net(folder / "yolox_tiny.onnx", [[np.nan] * 6])
    said: list[str] = []
    frames = pictures(tmp_path / "frames", boxes=True)
    asked = DetectRequest(frames=frames, rate_hz=10.0, detector_frames=AUTO)
    assert resolved(asked, said.append).detector_frames == "motion"
    assert any("gave no numbers" in line for line in said)


def test_classes_need_a_network_that_knows_them(tmp_path, fails_late):
    frames = pictures(tmp_path / "frames", boxes=True)
    line = fails_late(
        "detect", "--frames", frames, "--rate", "10", "--class", "car", "--out", tmp_path / "o.csv"
    )
    assert "no detector here that can be trusted knows classes" in line


@pytest.fixture
def fails_late(capsys):
    """Run a command that fails after it has said something; return its last line."""

    def run(*words):
        assert main([str(word) for word in words]) == 2
        return capsys.readouterr().err.splitlines()[-1]

    return run


def test_the_choice_for_a_camera_is_kept_while_the_same_networks_are_here(folder):
    usual, bicycles = DetectionSettings(), load_settings(None, ["model_frames.classes=[bicycle]"])
    assert kept_choice("rtsp://gantry/1", usual) is None
    keep_choice("rtsp://gantry/1", usual, "sehn")
    keep_choice("rtsp://gantry/2", usual, "motion")
    assert kept_choice("rtsp://gantry/1", usual) == "sehn"
    assert kept_choice("rtsp://gantry/2", usual) == "motion"
    assert kept_choice("rtsp://gantry/1", bicycles) is None  # other classes are looked for
    (folder / "yolox_tiny.onnx").write_bytes(b"new here")
    assert kept_choice("rtsp://gantry/1", usual) is None
    for damaged in (b"", b"[]", b'{"rtsp://gantry/1": 3}', b"\xff"):
        (folder / "chosen.json").write_bytes(damaged)
        assert kept_choice("rtsp://gantry/1", usual) is None
    keep_choice("rtsp://gantry/1", usual, "yolox-tiny")
    assert kept_choice("rtsp://gantry/1", usual) == "yolox-tiny"


def test_a_choice_by_an_empty_road_is_not_kept(tmp_path):
    from jeat_graph.detection.automatic import chosen_by

    still = [np.full((96, 128, 3), 110, dtype=np.uint8)] * 12
    kept: list[str] = []
    chosen_by(still, np.arange(12) / 4, DetectionSettings(), convinced=kept.append)
    assert kept == []


def test_a_name_is_never_second_guessed(tmp_path):
    asked = DetectRequest(frames=tmp_path / "absent.mp4", detector_frames="motion")
    assert resolved(asked) is asked


@pytest.mark.skipif(not DATA.is_dir(), reason=f"{DATA} is not there")
@pytest.mark.parametrize(
    ("clip", "here", "chosen"),
    [
        ("street/cars-cyclist.mp4", True, "yolox-nano"),
        ("street/cars-cyclist.mp4", False, "motion"),
        ("street/from-above.mp4", True, "motion"),
        ("davis346/street.aedat4", False, "motion"),
    ],
)
def test_real_streets(folder, clip, here, chosen):
    if here:
        for name in ("yolox_nano.onnx", "nanodet_m_416.onnx"):
            shutil.copy(DATA / "models" / name, folder / name)
    assert resolved(DetectRequest(frames=DATA / clip, detector_frames=AUTO)).detector_frames == chosen
