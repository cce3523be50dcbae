"""A run finds its inputs again from anywhere, and after both were moved."""

from __future__ import annotations

import json
import shutil

import pytest

from jeat_graph.cli.main import main
from jeat_graph.runs.inputs import check_distinct, describe_inputs, find_input


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """`scene/data/det.csv` and the folder `scene/out/run`, described from within `scene`."""
    home = tmp_path / "scene"
    (home / "data").mkdir(parents=True)
    (home / "out" / "run").mkdir(parents=True)
    (home / "data" / "det.csv").write_text("t,sensor\n")
    monkeypatch.chdir(home)
    record = describe_inputs(["data/det.csv"])[0]
    monkeypatch.chdir(tmp_path)
    return home, record


def test_an_input_is_found_from_another_working_folder(scene):
    home, record = scene
    assert record["path"] == "data/det.csv"
    assert find_input(record["path"], record, home / "out" / "run") == home / "data" / "det.csv"


def test_an_input_that_was_moved_with_its_run_is_found(scene, tmp_path):
    home, record = scene
    shutil.move(home, tmp_path / "elsewhere")
    moved = tmp_path / "elsewhere"
    assert find_input(record["path"], record, moved / "out" / "run") == moved / "data" / "det.csv"


def test_a_changed_file_goes_behind_an_unchanged_one(scene):
    home, record = scene
    (home / "out" / "run" / "det.csv").write_text("t,sensor\n")
    (home / "data" / "det.csv").write_text("changed\n")
    assert find_input(record["path"], record, home / "out" / "run") == home / "out" / "run" / "det.csv"
    (home / "out" / "run" / "det.csv").unlink()
    assert find_input(record["path"], record, home / "out" / "run") == home / "data" / "det.csv"


def test_nothing_is_found_where_there_is_nothing(scene):
    home, record = scene
    (home / "data" / "det.csv").unlink()
    assert find_input(record["path"], record, home / "out" / "run") is None


def test_a_list_of_images_is_found_where_the_run_was_moved(tmp_path, monkeypatch, capsys):
    home = tmp_path / "scene"
    home.mkdir()
    monkeypatch.chdir(home)
    images = [{"id": 7 + k, "timestamp": k / 20, "file_name": f"{k}.jpg"} for k in range(30)]
    boxes = [
        {"image_id": 7 + k, "bbox": [100 + 4 * k, 200, 60, 40], "score": 0.9, "category_id": 1}
        for k in range(30)
    ]
    (home / "images.json").write_text(json.dumps({"images": images}))
    (home / "results.json").write_text(json.dumps(boxes))
    assert main(["track", "results.json", "--images", "images.json", "--out", "run"]) == 0
    monkeypatch.chdir(tmp_path)
    shutil.move(home, tmp_path / "elsewhere")
    compare = ["compare", "elsewhere/run", "--no-plots", "--out", "comparison"]
    assert main(compare) == 0
    (tmp_path / "elsewhere" / "images.json").write_text("{}")
    capsys.readouterr()
    assert main(compare) == 2
    assert "list of images" in capsys.readouterr().err


def test_a_file_that_is_given_twice_is_refused_and_so_is_its_copy(tmp_path, capsys):
    rows = "".join(f"{k / 20},rgb,{100 + k},200,40,30,.9\n" for k in range(10))
    (tmp_path / "a.csv").write_text("t,sensor,left,top,width,height,score\n" + rows)
    (tmp_path / "b.csv").write_text((tmp_path / "a.csv").read_text())
    a, b, again = str(tmp_path / "a.csv"), str(tmp_path / "b.csv"), str(tmp_path / "." / "a.csv")
    for files, words in (
        ((a, again), "a.csv: is given twice"),
        ((f"rgb={a}", f"evt={a}"), "a.csv: is given twice"),
        ((a, b), f"b.csv: holds the same as {a}"),
    ):
        assert main(["track", *files, "--out", str(tmp_path / "run")]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert words in line
        assert not (tmp_path / "run").exists()


def test_sensors_that_saw_nothing_have_files_of_one_content(tmp_path):
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text("t,left,top,width,height,score\n0,,,,,\n0.05,,,,,\n")
    check_distinct([f"rgb={tmp_path / 'a.csv'}", f"evt={tmp_path / 'b.csv'}"])
