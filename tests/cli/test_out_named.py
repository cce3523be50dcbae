"""`--out` must name a place."""

from __future__ import annotations

import pytest

COMMANDS = [
    ("track", "det.csv"),
    ("render", "run"),
    ("export", "run", "--to", "coco"),
    ("count", "run", "--line", "0,0,9,9"),
    ("simulate", "night"),
    ("demo",),
    ("compare", "run"),
]


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command[0])
def test_an_empty_name_is_not_the_current_folder(tmp_path, monkeypatch, fails, command):
    monkeypatch.chdir(tmp_path)
    assert "--out is empty" in fails(*command, "--out", "")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command[0])
def test_a_dash_is_no_name_where_it_is_not_standard_output(tmp_path, monkeypatch, fails, command):
    monkeypatch.chdir(tmp_path)
    assert "--out -: does not write to standard output" in fails(*command, "--out", "-")
    assert list(tmp_path.iterdir()) == []


def test_detect_writes_to_standard_output(fails):
    assert "standard output" not in fails("detect", "--frames", "none.mp4", "--out", "-")
