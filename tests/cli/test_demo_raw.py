"""The part of `demo` that begins with raw pictures and events."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import pytest

from jeat_graph.cli import demo_raw
from jeat_graph.cli.main import build_parser, main


def test_each_command_is_one_that_anybody_can_repeat_and_begins_with_what_is_there():
    out = Path("somewhere")
    there = set()
    met = 0
    for command in demo_raw.commands(out):
        build_parser(command[0]).parse_args(command)
        given = [part for part in command if part.startswith("somewhere") and part != command[-1]]
        assert all(any(part.startswith(made) for made in there) for part in given), command
        met += len(given)
        there.add(command[-1] if "--gt" not in command else "somewhere")
    assert met > 3


@pytest.mark.skipif(not os.environ.get("JEAT_GRAPH_FULL"), reason="renders a clip: JEAT_GRAPH_FULL=1")
def test_raw_recordings_become_tracks_on_a_film(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(demo_raw, "FRAMES", 6)
    monkeypatch.setattr(demo_raw, "SIZE", "160x96")
    assert demo_raw.go_the_whole_way(tmp_path) == 0
    assert {"raw.mp4", "raw.png"} <= {path.name for path in tmp_path.iterdir()}
    assert (tmp_path / "raw" / "causal.csv").is_file()
    # Two panels, four moments.
    assert cv2.imread(str(tmp_path / "raw.png")).shape == (4 * 96, 2 * 160, 3)
    said = capsys.readouterr()
    assert said.err.count("demo: jeat-graph ") == len(demo_raw.commands(tmp_path))
    assert "raw.mp4" in said.out


def test_the_first_command_that_fails_ends_it(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(demo_raw, "SCENARIO", "nonsense")
    words = ["demo", "--from-raw", "--duration", "1", "--out", str(tmp_path / "demo")]
    assert main(words) == 2
    said = capsys.readouterr()
    assert "nonsense" in said.err
    assert "jeat-graph track" not in said.err
    assert "Next:" not in said.out
