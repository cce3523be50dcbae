"""Other trackers' results and other people's detections, from end to end."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest

from jeat_graph import evaluate
from jeat_graph.cli.main import main
from jeat_graph.io.tables.trajectories_io import read_trajectories

HZ = 20
FRAMES = 30
NAMES = {1: "car", 2: "truck"}


def left(k: int, i: int) -> int:
    """Left edge of vehicle `i` in frame `k` (px)."""
    return 100 + 300 * (i - 1) + 6 * k


def mot(first: int = 1, kind: str = "-1,-1,-1", score: str = "1") -> str:
    """Two vehicles as MOTChallenge text that counts from `first`."""
    return "".join(
        f"{k + first},{i},{left(k, i)},300,90,60,{score},{kind}\n" for k in range(FRAMES) for i in NAMES
    )


@pytest.fixture
def truth(tmp_path: Path) -> Path:
    """Their truth with classes, in seconds."""
    rows = "".join(
        f"{k / HZ},{i},{left(k, i)},300,90,60,{name}\n" for k in range(FRAMES) for i, name in NAMES.items()
    )
    path = tmp_path / "gt.csv"
    path.write_text("t,object_id,left,top,width,height,class\n" + rows)
    return path


def written(folder: Path, name: str) -> list[str]:
    """Write the vehicles as a result of a format, and return what commands need to read it."""
    path = folder / name
    if name == "labels":
        path.mkdir()
        (path / "classes.txt").write_text("person\ncar\ntruck\n")
        for k in range(FRAMES):
            lines = [
                f"{i} {(left(k, i) + 45) / 1280} {330 / 720} {90 / 1280} {60 / 720} {i}\n" for i in NAMES
            ]
            (path / f"night_{k + 1}.txt").write_text("".join(lines))
        return [str(path), "--image", "1280x720"]
    if name.endswith(".zip"):
        with zipfile.ZipFile(path, "w") as archive:
            text = [f"{k + 1},{i},{left(k, i)},300,90,60,1,{i},1\n" for k in range(FRAMES) for i in NAMES]
            archive.writestr("gt/gt.txt", "".join(text))
            archive.writestr("gt/labels.txt", "car\ntruck\n")
    elif name.endswith(".json"):
        boxes = [
            {"image_id": k + 1, "category_id": i, "bbox": [left(k, i), 300, 90, 60], "track_id": i}
            for k in range(FRAMES)
            for i in NAMES
        ]
        images = [{"id": k + 1, "file_name": f"{k:06d}.jpg"} for k in range(FRAMES)]
        kinds = [{"id": i, "name": kind} for i, kind in NAMES.items()]
        path.write_text(json.dumps({"images": images, "annotations": boxes, "categories": kinds}))
    elif name.endswith(".csv"):
        rows = "".join(
            f"{k},{left(k, i)},300,{left(k, i) + 90},360,0.8,{i},{kind},{i}\n"
            for k in range(FRAMES)
            for i, kind in NAMES.items()
        )
        path.write_text(
            "frame_index,x_min,y_min,x_max,y_max,confidence,class_id,class_name,tracker_id\n" + rows
        )
    return [str(path)]


@pytest.mark.parametrize("name", ["labels", "tracks.zip", "tracks.json", "tracks.csv"])
def test_a_result_of_any_format_is_judged_counted_and_exported(tmp_path, truth, capsys, name):
    result = written(tmp_path, name)
    command = ["eval", *result, "--gt", str(truth), "--rate", str(HZ), "--class", "car", "--json", "-"]
    assert main(command) == 0
    scores = json.loads(capsys.readouterr().out)["causal"]
    assert (scores["MOTA"], scores["FP"], scores["FN"]) == (100.0, 0, 0)
    assert scores["HOTA"] > 99.0

    assert (
        main(["count", *result, "--rate", str(HZ), "--line", "180,0,180,720", "--out", str(tmp_path / "c")])
        == 0
    )
    assert "1 crossings" in capsys.readouterr().err
    assert ",car" in (tmp_path / "c").read_text()

    out = tmp_path / "out.zip"
    assert main(["export", *result, "--rate", str(HZ), "--to", "cvat", "--out", str(out)]) == 0
    again = read_trajectories(out, rate_hz=HZ)
    assert sorted({*zip(again.track_id.tolist(), again.classes.tolist(), strict=True)}) == [
        (1, "car"),
        (2, "truck"),
    ]
    assert len(again) == 2 * FRAMES


def test_python_judges_them_too(tmp_path, truth):
    (result,) = written(tmp_path, "tracks.zip")
    assert evaluate(result, truth, classes=["truck"])["causal"]["MOTA"] == 100.0


def test_a_header_makes_no_difference_to_frame_1(tmp_path, truth, capsys):
    found = []
    for name, header in (("r.txt", ""), ("r.csv", "frame,id,left,top,width,height,conf,x,y,z\n")):
        (tmp_path / name).write_text(header + mot())
        assert main(["eval", str(tmp_path / name), "--gt", str(truth), "--rate", str(HZ), "--json", "-"]) == 0
        found.append(json.loads(capsys.readouterr().out))
    assert found[0] == found[1]
    assert found[0]["causal"]["HOTA"] == pytest.approx(100.0)


def test_text_from_frame_0_is_read_and_said(tmp_path, truth, capsys):
    (tmp_path / "r.txt").write_text(mot(first=0))
    assert main(["eval", str(tmp_path / "r.txt"), "--gt", str(truth), "--rate", str(HZ), "--json", "-"]) == 0
    told = capsys.readouterr()
    assert "r.txt: frames count from 0, for there is a frame 0" in told.err
    assert json.loads(told.out)["causal"]["MOTA"] == 100.0


def test_a_result_without_a_frame_0_counts_as_its_truth_does(tmp_path, capsys):
    """Trackers say nothing in their first frames."""
    header = "frame,track_id,left,top,width,height\n"
    rows = [f"{k},{i},{left(k, i)},300,90,60\n" for k in range(FRAMES) for i in NAMES]
    (tmp_path / "gt.csv").write_text(header + "".join(rows))
    (tmp_path / "r.csv").write_text(header + "".join(rows[4:]))
    command = [
        "eval",
        str(tmp_path / "r.csv"),
        "--gt",
        str(tmp_path / "gt.csv"),
        "--rate",
        str(HZ),
        "--json",
        "-",
    ]
    assert main(command) == 0
    told = capsys.readouterr()
    scores = json.loads(told.out)["causal"]
    assert (scores["FN"], scores["FP"]) == (4, 0)
    assert scores["MOTP"] == pytest.approx(100.0)
    assert "frames count from 0, as those of the truth do" in told.err


def test_numbers_of_a_tracker_are_no_names_of_the_challenge(tmp_path, truth, capsys):
    (tmp_path / "r.txt").write_text(mot(kind="3,-1"))
    command = ["eval", str(tmp_path / "r.txt"), "--gt", str(truth), "--rate", str(HZ), "--class", "car"]
    assert main(command) == 2
    assert "nothing is of class car; there are: 3 (--classes FILE names them" in capsys.readouterr().err
    assert main([*command, "--classes", "person,bicycle,car"]) == 0


@pytest.mark.parametrize("command", ["track", "eval", "count"])
def test_two_videos_are_refused_in_one_line_unless_one_is_chosen(tmp_path, truth, capsys, command):
    header = "video,frame,track_id,left,top,width,height\n"
    rows = [f"{v},{k},{i},{left(k, i)},300,90,60\n" for v in "ab" for k in range(FRAMES) for i in NAMES]
    (tmp_path / "two.csv").write_text(header + "".join(rows))
    more = {
        "track": ["--out", str(tmp_path / "run")],
        "eval": ["--gt", str(truth)],
        "count": ["--line", "180,0,180,720"],
    }
    words = [command, str(tmp_path / "two.csv"), "--rate", str(HZ), *more[command]]
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "two.csv: holds 2 videos (a, b): read one of them with --only-video NAME" in line
    assert not (tmp_path / "run").exists()
    assert main([*words, "--only-video", "b"]) == 0


def test_labels_of_yolo_are_tracked_and_the_run_says_from_what(tmp_path, capsys):
    labels = written(tmp_path, "labels")
    run = tmp_path / "run"
    assert main(["track", *labels, "--rate", str(HZ), "--out", str(run)]) == 0
    record = json.loads((run / "run.json").read_text())
    assert record["inputs"][0]["sha256"]
    assert record["reading"]["image"] == [1280, 720]
    assert record["counts"]["scans"] == FRAMES
    classes = read_trajectories(run / "smoothed.csv").final_classes()
    assert sorted(set(classes.values())) == ["car", "truck"]


class TestQuiet:
    def test_a_quiet_sequence_is_pooled_with_others(self, tmp_path, truth, capsys):
        (tmp_path / "r.txt").write_text(mot())
        (tmp_path / "quiet.txt").write_text("")
        (tmp_path / "quiet").mkdir()
        (tmp_path / "quiet" / "seqinfo.ini").write_text(f"[Sequence]\nframeRate={HZ}\nseqLength=10\n")
        (tmp_path / "quiet" / "gt.txt").write_text("")
        runs = [str(tmp_path / "r.txt"), str(tmp_path / "quiet.txt"), str(tmp_path / "quiet.txt")]
        truths = [str(truth), str(truth), str(tmp_path / "quiet" / "gt.txt")]
        assert main(["eval", *runs, "--gt", *truths, "--json", "-"]) == 0
        scores = json.loads(capsys.readouterr().out)["causal"]
        assert (scores["FP"], scores["FN"], scores["MOTA"]) == (0, 2 * FRAMES, 50.0)
        # Also where classes are asked for, which nothing in the quiet sequence has.
        assert main(["eval", *runs, "--gt", *truths, "--class", "car", "--json", "-"]) == 0
        assert json.loads(capsys.readouterr().out)["causal"]["FN"] == FRAMES

    def test_false_tracks_in_a_quiet_sequence_count(self, tmp_path, capsys):
        (tmp_path / "seqinfo.ini").write_text(f"[Sequence]\nframeRate={HZ}\nseqLength={FRAMES}\n")
        (tmp_path / "gt.txt").write_text("")
        (tmp_path / "r.txt").write_text(mot())
        assert main(["eval", str(tmp_path / "r.txt"), "--gt", str(tmp_path / "gt.txt"), "--json", "-"]) == 0
        assert json.loads(capsys.readouterr().out)["causal"]["FP"] == 2 * FRAMES

    def test_empty_detections_make_a_run_that_can_be_judged_and_counted(self, tmp_path, truth, capsys):
        (tmp_path / "seqinfo.ini").write_text(
            f"[Sequence]\nframeRate={HZ}\nseqLength={FRAMES}\nimWidth=640\nimHeight=480\n"
        )
        (tmp_path / "det.txt").write_text("")
        run = tmp_path / "run"
        assert main(["track", str(tmp_path / "det.txt"), "--out", str(run)]) == 0
        assert "all scans are empty" in capsys.readouterr().err
        assert len(read_trajectories(run / "causal.csv")) == 0
        assert main(["eval", str(run), "--gt", str(truth), "--json", "-"]) == 0
        assert json.loads(capsys.readouterr().out)["causal"]["FN"] == 2 * FRAMES
        assert main(["count", str(run), "--line", "180,0,180,720"]) == 0

    def test_truth_of_every_second_frame_is_as_good(self, tmp_path, truth, capsys):
        head, *rows = truth.read_text().splitlines()
        sparse = tmp_path / "sparse.csv"
        sparse.write_text("\n".join([head, *(row for k, row in enumerate(rows) if k // 2 % 2 == 0)]) + "\n")
        (tmp_path / "r.txt").write_text(mot())
        command = ["eval", str(tmp_path / "r.txt"), "--gt", str(sparse), "--json", "-", "--rate"]
        assert main([*command, str(HZ)]) == 0
        assert json.loads(capsys.readouterr().out)["causal"]["MOTA"] == 100.0
        assert main([*command, "33"]) == 2
        assert "--rate 33 does not fit the truth, whose rate is 10 Hz" in capsys.readouterr().err

    def test_a_result_that_would_end_after_its_truth_counts_from_1(self, tmp_path, capsys):
        head = "frame,track_id,left,top,width,height\n"
        for name, first in (("gt.csv", 0), ("result.csv", 1)):
            rows = [f"{k + first},1,{left(k, 1)},300,90,60\n" for k in range(FRAMES)]
            (tmp_path / name).write_text(head + "".join(rows))
        result, truth = (str(tmp_path / name) for name in ("result.csv", "gt.csv"))
        assert main(["eval", result, "--gt", truth, "--rate", str(HZ), "--json", "-"]) == 0
        assert json.loads(capsys.readouterr().out)["causal"]["MOTA"] == 100.0

    def test_classes_of_which_one_sequence_has_none_are_no_slip(self, tmp_path, truth, capsys):
        """Lorries alone in one sequence, cars in the other."""
        rows = truth.read_text().splitlines()
        (tmp_path / "lorries.csv").write_text(
            "\n".join([rows[0], *(r for r in rows if r.endswith("truck"))]) + "\n"
        )
        names = tmp_path / "labels.txt"
        names.write_text("car\ntruck\n")
        (tmp_path / "r.txt").write_text(
            "".join(f"{k + 1},2,{left(k, 2)},300,90,60,1,2,-1\n" for k in range(FRAMES))
        )
        runs, truths = [str(tmp_path / "r.txt")] * 2, [str(tmp_path / "lorries.csv"), str(truth)]
        assert main(["eval", *runs, "--gt", *truths, "--class", "car", "--json", "-"]) == 0
        assert json.loads(capsys.readouterr().out)["causal"]["FN"] == FRAMES


def test_a_real_detector_s_boxes_beyond_the_picture_are_tracked(tmp_path, capsys):
    folder = Path(__file__).resolve().parents[3] / "shared" / "data" / "mot17-yolox" / "MOT17-05"
    if not folder.is_dir():
        pytest.skip("the real data lie in ../shared/data, which is not here")
    out = tmp_path / "run"
    assert main(["track", str(folder / "detections.csv"), "--image", "640x480", "--out", str(out)]) == 0
    assert "box centres lie outside the picture of 640 x 480 px" in capsys.readouterr().err
    assert np.isfinite(read_trajectories(out / "causal.csv").boxes).all()
