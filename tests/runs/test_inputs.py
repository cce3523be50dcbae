"""A run finds its inputs again from anywhere, and after both were moved."""

from __future__ import annotations

import shutil

import pytest

from jeat_graph.runs.inputs import describe_inputs, find_input


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
