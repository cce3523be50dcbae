"""Layouts are written whole or not at all, and always with the same bytes."""

from __future__ import annotations

import hashlib
import shutil
from pathlib import Path

import pytest

from jeat_graph.cli.main import main
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph_sehn.simulation.layouts.writing import write_layout


def sums(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
        if path.is_file()
    }


@pytest.mark.parametrize("layout", ["rvt", "dsec-det"])
def test_the_same_set_gives_the_same_bytes(layout: str, rectangle_set: Path, tmp_path: Path):
    for name in ("a", "b"):
        write_layout(rectangle_set, layout, tmp_path / name)
    assert sums(tmp_path / "a") == sums(tmp_path / "b") != {}


def test_a_folder_that_holds_something_is_left_alone(rectangle_set: Path, tmp_path: Path):
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "thesis.txt").write_text("mine")
    with pytest.raises(DataError, match="not empty"):
        write_layout(rectangle_set, "rvt", tmp_path / "own")
    assert sums(tmp_path / "own").keys() == {"thesis.txt"}


def test_a_damaged_set_leaves_nothing(rectangle_set: Path, tmp_path: Path, capsys):
    broken = shutil.copytree(rectangle_set, tmp_path / "set")
    (broken / "segments/000002/boxes.npy").write_bytes(b"no array")
    assert main(["export", str(broken), "--to", "rvt", "--out", str(tmp_path / "out")]) == 2
    assert "boxes.npy: cannot be read" in capsys.readouterr().err
    assert [p.name for p in tmp_path.iterdir()] == ["set"]


@pytest.mark.parametrize(
    ("missing", "words"), [("manifest.json", "no manifest.json"), ("segments", "no such file")]
)
def test_a_set_that_is_not_whole_is_refused(missing: str, words: str, rectangle_set: Path, tmp_path: Path):
    part = shutil.copytree(rectangle_set, tmp_path / "set")
    if missing == "segments":
        shutil.rmtree(part / missing)
    else:
        (part / missing).unlink()
    with pytest.raises(DataError, match=words):
        write_layout(part, "dsec-det", tmp_path / "out")


def test_an_unknown_layout_is_refused(rectangle_set: Path, tmp_path: Path):
    with pytest.raises(ConfigError, match="rvt, rvt-input, dsec-det"):
        write_layout(rectangle_set, "yolo", tmp_path / "out")
