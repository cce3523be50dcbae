"""Classes that a network says: through detections, tracks and counts, and chosen by name."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pandas as pd
import pytest

from jeat_graph.cli.main import main

pytest.importorskip("onnx", reason="pip install onnx")

from ..detection.models.tiny import constant_net

SIDE = (128, 96)
NAMES = {0: "person", 1: "bicycle", 2: "car", 7: "truck"}
# A car that a truck's box lies on with a lower score, a truck, a person, and a bicycle.
ROWS = [
    [10, 20, 50, 60, 0.9, 2],
    [10, 21, 50, 60, 0.6, 7],
    [70, 20, 110, 60, 0.8, 7],
    [4, 64, 14, 90, 0.7, 0],
    [60, 70, 80, 90, 0.65, 1],
]


@pytest.fixture
def street(tmp_path):
    (tmp_path / "frames").mkdir()
    for k in range(20):
        cv2.imwrite(str(tmp_path / "frames" / f"{k:03d}.png"), np.full((96, 128, 3), 90, dtype=np.uint8))
    constant_net(tmp_path / "net.onnx", {"output0": np.array([ROWS])}, SIDE, notes={"names": str(NAMES)})
    return tmp_path


def words(street, name, *more):
    out = street / ("out.csv" if name == "detect" else "run")
    net = ["--detector-frames", str(street / "net.onnx")]
    return [name, "--frames", str(street / "frames"), "--rate", "20", *net, "--out", str(out), *more]


def test_vehicles_have_the_names_that_the_network_gives(street, capsys):
    assert main(words(street, "detect")) == 0
    assert pd.read_csv(street / "out.csv").groupby("class").size().to_dict() == {"car": 20, "truck": 20}
    assert "classes: car 20, truck 20" in capsys.readouterr().out


def test_classes_go_from_the_network_to_tracks_and_counts(street, capsys):
    assert main(words(street, "track")) == 0
    for name in ("causal", "smoothed"):
        last = pd.read_csv(street / "run" / f"{name}.csv").groupby("track_id").last()
        assert sorted(last["class"]) == ["car", "truck"]
    capsys.readouterr()
    line = ["--line", "0,60,128,60", "--class", "car"]
    assert main(["count", str(street / "run"), *line, "--out", str(street / "counts.csv")]) == 0


@pytest.mark.parametrize("command", ["detect", "track"])
def test_other_classes_are_looked_for_where_they_are_asked_for(street, command):
    assert main(words(street, command, "--class", "bicycle", "person")) == 0
    file = street / "out.csv" if command == "detect" else street / "run" / "detections.csv"
    assert set(pd.read_csv(file)["class"]) == {"bicycle", "person"}
    assert main(words(street, command, "--class", "all")) == 0
    assert set(pd.read_csv(file)["class"]) == {"bicycle", "person", "car", "truck"}


def test_lines_for_stream_have_classes(street, capsys):
    arguments = words(street, "detect")
    arguments[-1] = "-"
    assert main(arguments) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[0])["classes"] == ["car", "truck"]


def test_tracking_a_class_that_was_not_seen_gives_no_tracks(street):
    constant_net(street / "net.onnx", {"output0": np.array([ROWS[:2]])}, SIDE, notes={"names": str(NAMES)})
    assert main(words(street, "track", "--class", "bicycle")) == 0
    assert len(pd.read_csv(street / "run" / "smoothed.csv")) == 0


def test_what_knows_no_classes_is_not_asked_for_any(street, fails, capsys):
    folder = ("--frames", str(street / "frames"), "--rate", "20", "--out", str(street / "out.csv"))
    folder += ("--detector-frames", "motion")
    assert "--class: what moves has no class" in fails("detect", *folder, "--class", "car")
    assert main(words(street, "detect", "--class", "lorry")) == 2
    assert "'lorry' is none of the network's" in capsys.readouterr().err
    both = ("--class", "car", "--detection-set", "model_frames.classes=[car]")
    assert "say the same twice" in fails(*words(street, "detect", *both))
