"""Classes of detections on their way through the commands: track, eval, count, render, export, stream."""

from __future__ import annotations

import io
import json
import zipfile

import pandas as pd
import pytest

from jeat_graph.cli.main import main
from jeat_graph.io.tables.trajectories_io import read_trajectories

STEPS = 40


def row(k: int, kind: str, down: bool) -> str:
    """A vehicle that drives down the picture at the left, or up at the right."""
    x, y = (300, 100 + 10 * k) if down else (700, 550 - 10 * k)
    return f"{k / 20},rgb,{x},{y},60,50,0.9,{kind}"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A car that drives down and is called a van now and then, a truck that drives up, and their truth."""
    folder = tmp_path_factory.mktemp("classes")
    lines = ["t,sensor,left,top,width,height,score,class"]
    truth = ["t,object_id,left,top,width,height,class"]
    for k in range(STEPS):
        lines += [row(k, "van" if k % 4 == 1 else "car", True), row(k, "truck", False)]
        for number, (kind, down) in enumerate((("car", True), ("truck", False)), 1):
            t, _, *box = row(k, kind, down).split(",")[:6]
            truth.append(",".join([t, str(number), *box, kind]))
    (folder / "det.csv").write_text("\n".join(lines) + "\n")
    (folder / "gt.csv").write_text("\n".join(truth) + "\n")
    out = folder / "run"
    formats = ("--format", "parquet", "kitti", "motchallenge", "--smoother", "full")
    assert main(["track", str(folder / "det.csv"), "--out", str(out), *formats]) == 0
    return folder


def test_track_writes_the_class_of_each_track_in_every_format_that_has_one(run):
    for name in ("causal.csv", "smoothed.csv"):
        table = pd.read_csv(run / "run" / name)
        begin = list(table.columns).index("sensors")
        assert list(table.columns)[begin : begin + 3] == ["sensors", "class", "class_probability"]
        last = table.groupby("track_id").last()
        assert sorted(last["class"]) == ["car", "truck"]
        assert last.set_index("class").class_probability["car"] == pytest.approx(0.75, abs=1e-6)
    assert set(pd.read_parquet(run / "run" / "smoothed.parquet")["class"]) == {"car", "truck"}
    kitti = next((run / "run").glob("smoothed.kitti*"))
    assert {line.split()[2] for line in kitti.read_text().splitlines()} == {"car", "truck"}
    assert set(read_trajectories(kitti, fmt="kitti").classes) == {"car", "truck"}
    mot = next((run / "run").glob("smoothed.mot*"))
    rows = mot.read_text().splitlines()
    assert rows
    assert all(line.endswith(",-1,-1,-1") for line in rows)


def test_track_takes_only_detections_of_a_class_and_compare_takes_the_same_again(run, tmp_path, capsys):
    out = tmp_path / "cars"
    assert main(["track", str(run / "det.csv"), "--class", "car", "van", "--out", str(out)]) == 0
    assert set(pd.read_csv(out / "smoothed.csv")["class"]) <= {"car", "van"}
    assert json.loads((out / "run.json").read_text())["reading"]["classes"] == ["car", "van"]
    assert main(["compare", str(out), "--out", str(tmp_path / "c"), "--no-plots"]) == 0
    assert main(["track", str(run / "det.csv"), "--class", "Car", "--out", str(tmp_path / "x")]) == 2
    assert "there are: car, truck, van" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


def test_eval_of_one_class_looks_past_tracks_of_another(run, capsys):
    for kinds, found in ((["car"], STEPS), (["car", "truck"], 2 * STEPS)):
        capsys.readouterr()
        arguments = ["eval", str(run / "run"), "--gt", str(run / "gt.csv"), "--json", "-", "--class", *kinds]
        assert main(arguments) == 0
        scores = json.loads(capsys.readouterr().out)["smoothed"]
        assert scores["FP"] == 0
        assert scores["FN"] <= 1
        assert scores["MOTA"] > 95
        assert scores["TP"] + scores["FN"] == found
    assert main(["eval", str(run / "run"), "--gt", str(run / "gt.csv"), "--class", "lorry"]) == 2
    assert "truck" in capsys.readouterr().err


def test_count_is_by_class_and_direction(run, tmp_path, capsys):
    line = ["--line", "gate=0,330,1280,330"]
    out = tmp_path / "counts.csv"
    assert main(["count", str(run / "run"), *line, "--out", str(out)]) == 0
    counts = pd.read_csv(out)
    found = dict(zip(zip(counts["class"], counts.direction, strict=True), counts["count"], strict=True))
    assert found == {("car", "right"): 1, ("truck", "left"): 1}
    capsys.readouterr()
    assert main(["count", str(run / "run"), *line, "--class", "truck"]) == 0
    shown = capsys.readouterr().out
    assert "truck" in shown
    assert "car" not in shown
    assert main(["count", str(run / "run"), *line, "--class", "bus"]) == 2


def test_render_draws_one_class_only(run, tmp_path):
    pictures = []
    for more in ([], ["--class", "truck"], ["--class", "truck", "car"]):
        out = tmp_path / f"{len(pictures)}.png"
        arguments = ["render", str(run / "run"), "--at", "1.5", "--size", "320x180", "--out", str(out)]
        assert main([*arguments, *more]) == 0
        pictures.append(out.read_bytes())
    assert pictures[0] == pictures[2]
    assert pictures[0] != pictures[1]


def test_cvat_and_coco_have_the_classes_as_labels(run, tmp_path):
    rate = ["--output-rate", "20"]
    assert main(["export", str(run / "run"), "--to", "cvat", *rate, "--out", str(tmp_path / "t.zip")]) == 0
    with zipfile.ZipFile(tmp_path / "t.zip") as archive:
        labels = archive.read("gt/labels.txt").decode().splitlines()
        rows = [line.split(",") for line in archive.read("gt/gt.txt").decode().splitlines()]
    assert labels == ["car", "truck"]
    assert {labels[int(one[7]) - 1] for one in rows if float(one[2]) > 500} == {"truck"}
    out = tmp_path / "tracks.json"
    assert main(["export", str(run / "run"), "--to", "coco", *rate, "--out", str(out)]) == 0
    content = json.loads(out.read_text())
    names = {one["id"]: one["name"] for one in content["categories"]}
    assert {names[one["category_id"]] for one in content["annotations"] if one["bbox"][0] > 500} == {"truck"}
    assert len(content["images"]) == STEPS
    assert {one["image_id"] for one in content["annotations"]} <= {one["id"] for one in content["images"]}


class Lines:
    """Something with the bytes of standard input."""

    def __init__(self, text: str) -> None:
        self.buffer = io.BytesIO(text.encode())


def streamed(monkeypatch, capsys, text: str, *arguments: str) -> str:
    monkeypatch.setattr("sys.stdin", Lines(text))
    capsys.readouterr()
    assert main(["stream", *arguments]) == 0
    return capsys.readouterr().out


def scans(named: bool, per_second: float = 1.0) -> str:
    lines = []
    for k in range(20):
        scan = {
            "t": k / 20 * per_second,
            "sensor": "rgb",
            "boxes": [[300, 100 + 10 * k, 60, 50]],
            "scores": [0.9],
        }
        lines.append(json.dumps(scan | ({"classes": ["car" if k % 3 else None]} if named else {})))
    return "\n".join(lines) + "\n"


def test_stream_says_the_class_of_each_track(monkeypatch, capsys, tmp_path):
    out = streamed(monkeypatch, capsys, scans(True), "--smoothed", str(tmp_path / "s.csv"))
    last = json.loads(out.splitlines()[-1])["tracks"][0]
    assert (last["class"], last["class_probability"]) == ("car", 1.0)
    assert set(pd.read_csv(tmp_path / "s.csv")["class"].dropna()) == {"car"}
    out = streamed(monkeypatch, capsys, scans(True), "--format", "csv")
    assert out.splitlines()[0].endswith(",sensors,class,class_probability,var_width,var_height")
    out = streamed(monkeypatch, capsys, scans(False), "--format", "csv")
    assert out.splitlines()[0].endswith(",sensors,var_width,var_height")
    assert "class" not in streamed(monkeypatch, capsys, scans(False))


def test_stream_takes_classes_of_csv(monkeypatch, capsys):
    text = "t,sensor,left,top,width,height,score,class\n" + "\n".join(row(k, "car", True) for k in range(20))
    out = streamed(monkeypatch, capsys, text + "\n")
    assert json.loads(out.splitlines()[-1])["tracks"][0]["class"] == "car"


def test_stream_takes_times_in_other_units(monkeypatch, capsys):
    seconds = streamed(monkeypatch, capsys, scans(True))
    assert streamed(monkeypatch, capsys, scans(True, 1000.0), "--time-unit", "ms") == seconds


def test_classes_that_are_no_names_are_one_clear_line(monkeypatch, capsys):
    for wrong in ('["car", "van"]', '"car"', "[[3]]"):
        line = '{"t": 0, "sensor": "rgb", "boxes": [[1, 2, 3, 4]], "scores": [0.9], "classes": ' + wrong
        monkeypatch.setattr("sys.stdin", Lines(line + "}\n"))
        assert main(["stream"]) == 2
        error = capsys.readouterr().err
        assert "classes" in error
        assert "<stdin>:1" in error


def test_the_picture_is_as_large_as_the_boxes_of_all_classes_reach(tmp_path):
    rows = [
        f"{k / 20},rgb,{left},100,60,40,.9,{name}"
        for k in range(30)
        for left, name in ((90, "car"), (900, "bus"))
    ]
    path = tmp_path / "d.csv"
    path.write_text("t,sensor,left,top,width,height,score,class\n" + "\n".join(rows) + "\n")
    assert main(["track", str(path), "--class", "car", "--out", str(tmp_path / "run")]) == 0
    record = json.loads((tmp_path / "run" / "run.json").read_text())
    assert record["config"]["image"]["width"] == 960
    assert record["counts"]["detections"] == 30
