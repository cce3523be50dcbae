"""`jeat-graph teach`: what it writes, what it refuses, and in which words."""

from __future__ import annotations

import builtins
import json

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.io.events.indexed import open_indexed

from ..teaching.drawn_road import SIZE, vehicles_at, write_pictures, write_recording


@pytest.fixture(scope="module")
def minute(tmp_path_factory):
    """A minute of a drawn road: detections of both sensors, events, and pictures."""
    folder = tmp_path_factory.mktemp("road")
    write_recording(folder, 60.0)
    write_pictures(folder, 60.0, each_s=0.5)
    return folder


def refused(capsys, *words):
    """The one line that a command answers with."""
    assert main(["teach", *map(str, words)]) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert line.startswith("jeat-graph teach: ")
    return line


def test_without_pytorch_the_packages_are_named(tmp_path, capsys, monkeypatch):
    real = builtins.__import__

    def lacking(name, *rest, **more):
        if name.partition(".")[0] == "torch":
            raise ImportError("no module named torch")
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", lacking)
    line = refused(capsys, "d.csv", "--events", "e.h5", "--detector", "sehn", "--out", tmp_path / "n.onnx")
    assert "pip install './sehn[train]'" in line


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--events", "e.h5"], "--detector NAME|FILE and --out FILE.onnx are needed"),
        (["--events", "e.h5", "--dataset", "kitti", "out"], "must be one of coco, yolo, dsec"),
        (["--events", "e.h5", "--dataset", "coco", "out"], "is of pictures, give --frames VIDEO"),
        (["--frames", "v", "--dataset", "dsec", "out"], "is of events, give --events FILE"),
        (
            ["--frames", "v", "--dataset", "coco", "out", "--detector", "sehn"],
            "leave --out and --detector out",
        ),
        (["--events", "e.h5", "--detector", "sehn", "--out", "n.pt"], "must end in .onnx"),
        (["--events", "e.h5", "--held-back", "1", "--dataset", "dsec", "out"], "--held-back"),
    ],
)
def test_what_does_not_go_together_is_said_first(capsys, words, said):
    assert said in refused(capsys, "d.csv", *words)


@pytest.mark.parametrize(
    ("detector", "said"),
    [
        ("motion", "motion has no weights that could learn"),
        ("sehn-int8", "8-bit numbers, which cannot learn"),
    ],
)
def test_detectors_that_cannot_learn_are_refused_by_name(tmp_path, capsys, detector, said):
    pytest.importorskip("torch", reason="teaching needs PyTorch, the extra `train`")
    line = refused(capsys, "d.csv", "--events", "e.h5", "--detector", detector, "--out", tmp_path / "n.onnx")
    assert said in line


def test_a_short_recording_is_refused_with_what_would_be_needed(tmp_path, capsys):
    write_recording(tmp_path, 3.0)
    out = tmp_path / "set"
    line = refused(
        capsys, tmp_path / "detections.csv", "--events", tmp_path / "events.h5", "--dataset", "dsec", out
    )
    assert "too little to learn from" in line
    assert "needed are 30 s with 10, and 12 s with 5" in line
    assert not out.exists()


def test_clocks_that_do_not_meet_are_refused(minute, tmp_path, capsys):
    words = [minute / "detections.csv", "--events", minute / "events.h5", "--event-delay", "0"]
    table = (minute / "detections.csv").read_text(encoding="utf-8").splitlines()
    late = tmp_path / "late.csv"
    moved = [f"{float(row.partition(',')[0]) + 500.0},{row.partition(',')[2]}" for row in table[1:]]
    late.write_text("\n".join([table[0], *moved]) + "\n", encoding="utf-8")
    line = refused(capsys, late, *words[1:3], "--dataset", "dsec", tmp_path / "set")
    assert "say what they are later with --event-delay S" in line


def test_events_are_written_as_dsec_has_them_without_those_of_masks(minute, tmp_path, capsys):
    out = tmp_path / "set"
    words = [minute / "detections.csv", "--events", minute / "events.h5", "--dataset", "dsec", out]
    assert main(["teach", *map(str, words)]) == 0
    assert "boxes to train on" in capsys.readouterr().out
    for name, span in (("train/taught", (0.0, 43.0)), ("test/held-back", (45.0, 60.0))):
        boxes = np.load(out / name / "object_detections" / "left" / "tracks.npy")
        assert len(boxes) > 100
        assert (boxes["t"] >= span[0] * 1e6).all()
        assert (boxes["t"] <= span[1] * 1e6).all()
        for row in boxes[:: len(boxes) // 20]:
            _, true = vehicles_at(row["t"] / 1e6)
            found = np.array([row[key] for key in ("x", "y", "w", "h")])
            assert np.abs(true - found).max(axis=1).min() < 1.0
        with open_indexed(out / name / "events" / "left" / "events.h5") as file:
            kept = len(file.between(0, 60_000_000))
        with open_indexed(minute / "events.h5") as file:
            there = len(file.between(int(boxes["t"].min()), int(boxes["t"].max())))
        assert 0.3 * there < kept < there  # vehicles that come and go are left out
    assert (out / "train_val_test_split.yaml").is_file()


def test_pictures_are_written_as_coco_and_yolo_have_them(minute, tmp_path):
    cv2 = pytest.importorskip("cv2")
    words = [minute / "detections.csv", "--frames", minute / "frames", "--dataset"]
    assert main(["teach", *map(str, [*words, "coco", tmp_path / "coco"])]) == 0
    found = json.loads((tmp_path / "coco" / "train.json").read_text(encoding="utf-8"))
    sure = [one for one in found["annotations"] if not one["iscrowd"]]
    names = {one["id"]: one["file_name"] for one in found["images"]}
    assert len(sure) > 50
    for one in sure[:: len(sure) // 10]:
        picture = cv2.imread(str(tmp_path / "coco" / "images" / names[one["image_id"]]))
        left, top, width, height = (round(value) for value in one["bbox"])
        assert picture[top + 1 : top + height - 1, left + 1 : left + width - 1].min() == 200
        assert 0.8 <= one["score"] <= 1.0
    assert any(one["iscrowd"] for one in found["annotations"])

    assert main(["teach", *map(str, [*words, "yolo", tmp_path / "yolo"])]) == 0
    labels = sorted((tmp_path / "yolo" / "labels" / "train").iterdir())
    boxes = 0
    for path in labels:
        picture = cv2.imread(str(tmp_path / "yolo" / "images" / "train" / f"{path.stem}.png"))
        bright = picture[..., 0] == 200
        for line in path.read_text(encoding="utf-8").splitlines():
            kind, *shares = line.split()
            x, y, width, height = np.array([float(value) for value in shares]) * [*SIZE, *SIZE]
            rows = slice(max(round(y - height / 2 - 1), 0), round(y + height / 2 + 1))
            columns = slice(max(round(x - width / 2 - 1), 0), round(x + width / 2 + 1))
            assert (kind, bright[rows, columns].any()) == ("0", True)
            bright[rows, columns] = False
            boxes += 1
        assert not bright.any()  # who is not asked for is painted over
    assert boxes == len(sure)


def test_what_gained_nothing_is_refused_and_nothing_is_written(minute, tmp_path, capsys, monkeypatch):
    pytest.importorskip("torch", reason="teaching needs PyTorch, the extra `train`")
    monkeypatch.setattr("jeat_graph_sehn.teaching.learning_from.PIECES", 2)
    from ..teaching.networks import FAST, write_network

    start, out = write_network(tmp_path / "start.onnx", width=2), tmp_path / "out" / "n.onnx"
    changes = [*(f"{key}={json.dumps(value)}" for key, value in FAST.items()), "learning_rate=1e-9"]
    words = [minute / "detections.csv", "--events", minute / "events.h5", "--detector", start, "--out", out]
    words += ["--old-share", "0", "--steps", "1", "--threads", "1"]
    words += [word for change in changes for word in ("--set", change)]
    assert main(["teach", *map(str, words)]) == 1
    shown = capsys.readouterr()
    assert "own road, held back: AP50" in shown.out
    assert "nothing is written: it gained" in shown.err.splitlines()[-1]
    assert "wrote" not in shown.out
    assert [path.name for path in tmp_path.iterdir()] == ["start.onnx"]


def test_a_network_of_others_is_sent_to_the_data_set(minute, tmp_path, capsys):
    pytest.importorskip("torch", reason="teaching needs PyTorch, the extra `train`")
    onnx = pytest.importorskip("onnx")
    value = onnx.helper.make_tensor_value_info("x", onnx.TensorProto.FLOAT, [1, 3, 8, 8])
    graph = onnx.helper.make_graph(
        [onnx.helper.make_node("Identity", ["x"], ["y"])],
        "g",
        [value],
        [onnx.helper.make_tensor_value_info("y", onnx.TensorProto.FLOAT, [1, 3, 8, 8])],
    )
    onnx.save(onnx.helper.make_model(graph), str(tmp_path / "other.onnx"))
    words = [
        "--events",
        minute / "events.h5",
        "--detector",
        tmp_path / "other.onnx",
        "--out",
        tmp_path / "n.onnx",
    ]
    line = refused(capsys, minute / "detections.csv", *words)
    assert "is no network that `train` made, so it cannot be taught here: `--dataset dsec DIR` writes" in line
