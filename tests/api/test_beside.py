"""Without jeat-graph-sehn everything else works, and what it would do is refused in one line."""

from __future__ import annotations

import importlib.metadata
from importlib.metadata import EntryPoint, EntryPoints

import pytest

import jeat_graph
from jeat_graph.cli.main import main

ALL = importlib.metadata.entry_points


def without_ours(**asked):
    return () if asked.get("group", "").startswith("jeat_graph.") else ALL(**asked)


@pytest.fixture
def alone(monkeypatch):
    """An installation without jeat-graph-sehn."""
    monkeypatch.setattr(importlib.metadata, "entry_points", without_ours)


def one_line(capsys) -> str:
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    return said.err


@pytest.mark.parametrize(
    ("arguments", "begins"),
    [
        (
            ["simulate", "night", "--out", "sim"],
            "jeat-graph simulate: the command comes with jeat-graph-sehn",
        ),
        (["simulate", "--help"], "jeat-graph simulate: the command comes with jeat-graph-sehn"),
        (["train", "frames", "sim", "--out", "n.onnx"], "jeat-graph train: the command comes with"),
        (["teach", "run", "--events", "e.h5", "--out", "n.onnx"], "jeat-graph teach: the command comes with"),
        (["export", "sim", "--to", "rvt", "--out", "x"], "jeat-graph export: --to rvt comes with"),
        (["demo", "--scenario", "day", "--out", "x"], "jeat-graph demo: another highway comes with"),
        (["demo", "--seed", "3", "--out", "x"], "jeat-graph demo: another highway comes with"),
        (["demo", "--from-raw", "--out", "x"], "jeat-graph demo: --from-raw comes with"),
    ],
)
def test_what_it_brings_says_how_to_get_it(alone, arguments, begins, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    line = one_line(capsys)
    assert line.startswith(begins)
    assert "`pip install ./sehn` in a checkout" in line
    assert list(tmp_path.iterdir()) == []


def test_the_function_says_so_too(alone):
    with pytest.raises(
        jeat_graph.JeatGraphError, match=r"^simulate comes with jeat-graph-sehn.*install ./sehn"
    ):
        jeat_graph.simulate()


def test_the_overview_lists_the_commands_and_how_to_get_them(alone, capsys):
    with pytest.raises(SystemExit) as end:
        main(["--help"])
    assert end.value.code == 0
    words = " ".join(capsys.readouterr().out.split())
    assert "simulate comes with jeat-graph-sehn" in words
    assert "train comes with jeat-graph-sehn" in words


def test_the_demo_tracks_the_recording_that_comes_along(alone, tmp_path, capsys):
    assert main(["demo", "--out", str(tmp_path)]) == 0
    rows = [line.split("|")[1:4] for line in (tmp_path / "scores.md").read_text().splitlines()[2:]]
    mota = {name.strip(): float(value) for name, value, _ in rows}
    assert mota["evt + rgb"] > max(mota["evt alone"], mota["rgb alone"])
    # Eight seconds at night: what the sensors are like is learnt in them, with a third of the tracks begun.
    assert mota["evt + rgb, smoothed"] > mota["evt + rgb"] > 70.0
    assert (tmp_path / "tracks.png").read_bytes().startswith(b"\x89PNG")
    assert "night-nolight" in capsys.readouterr().err


def test_one_that_cannot_be_loaded_is_named(monkeypatch, capsys):
    broken = EntryPoint("simulate", "jeat_graph_nowhere.commands", "jeat_graph.commands")
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda **asked: (broken,))
    assert main(["simulate", "night", "--out", "sim"]) == 2
    line = one_line(capsys)
    assert "cannot be loaded from jeat_graph_nowhere.commands: No module named" in line


def test_a_command_of_before_says_where_it_went(capsys):
    assert main(["benchmark", "real"]) == 2
    assert "python -m benchmarks" in one_line(capsys)


def test_a_checkout_that_is_newer_than_its_entry_points_has_its_commands(tmp_path, monkeypatch, capsys):
    """As `git pull` leaves an editable install: the module is there, and no entry point names it."""
    package = tmp_path / "pulled"
    package.mkdir()
    (package / "__init__.py").write_text("", encoding="utf-8")
    text = "HELP = 'new'\ndef add_arguments(parser): ...\ndef run(args): print('taught')\n"
    (package / "teach_command.py").write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    old = EntryPoints([EntryPoint("train", "pulled.train_command", "jeat_graph.commands")])
    monkeypatch.setattr(importlib.metadata, "entry_points", old.select)
    assert main(["teach"]) == 0
    assert capsys.readouterr().out == "taught\n"
    assert main(["simulate"]) == 2
    assert "comes with jeat-graph-sehn, which is not installed" in one_line(capsys)
