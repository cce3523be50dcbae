"""`demo --film`: a film of a simulated highway, or of a recording of the user's."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from jeat_graph.cli import demo_film
from jeat_graph.cli.main import build_parser, main
from jeat_graph.io.media.video import open_frames


def test_each_command_is_one_that_anybody_can_repeat_and_reads_what_the_ones_before_wrote():
    commands = demo_film.simulated_commands(Path("somewhere"), "default")
    written = []
    for command in commands:
        build_parser(command[0]).parse_args(command)
        out = command.index("--out")
        read = [word for word in command[:out] if word.startswith("somewhere")]
        assert all(any(word.startswith(made) for made in written) for word in read), command
        written.append(command[out + 1])
    assert written == [f"somewhere/{name}" for name in ("film-clip", "film-run", "film.mp4", "film.png")]
    assert demo_film.FRAMES / 20.0 == 20.0
    assert commands[2].count("--line") == 2


@pytest.fixture
def street(tmp_path):
    """A video of a bright box that crosses x = 80 to the right, 10 frames a second."""
    path = tmp_path / "street.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (160, 96))
    noise = np.random.default_rng(0)
    for k in range(40):
        picture = noise.integers(88, 92, (96, 160, 3), dtype=np.uint8)
        left = 4 * (k - 12)
        if k >= 12:
            picture[40:60, max(left, 0) : left + 30] = (40, 200, 220)
        writer.write(picture)
    writer.release()
    return path


def test_a_video_of_ones_own_becomes_a_film_with_both_tracks_and_counts(street, tmp_path, capsys):
    out = tmp_path / "demo"
    given = ["--frames", str(street), "--line", "gate=80,0,80,96"]
    assert main(["demo", "--film", *given, "--out", str(out)]) == 0
    said = capsys.readouterr()
    assert f"film      {out / 'film.mp4'}" in said.out
    assert said.err.count("demo: jeat-graph ") == 3
    with open_frames(out / "film.mp4", None) as film:
        assert len(film.times_s) == 40
    assert cv2.imread(str(out / "film.png")).shape == (2 * 96, 160, 3)
    assert {"causal.csv", "smoothed.csv"} <= {path.name for path in (out / "film-run").iterdir()}


def test_what_does_not_belong_to_the_film_is_refused(tmp_path, fails):
    out = ["--out", tmp_path / "demo"]
    assert "--line is of the film: add --film" in fails("demo", "--line", "0,0,9,9", *out)
    assert "--line goes with --frames" in fails("demo", "--film", "--line", "0,0,9,9", *out)
    assert "scenario of its own" in fails("demo", "--film", "--seed", "3", *out)
    assert not (tmp_path / "demo").exists()


def test_a_command_that_fails_ends_it_with_its_own_line(tmp_path, capsys):
    assert main(["demo", "--film", "--frames", "nowhere.mp4", "--out", str(tmp_path / "demo")]) == 2
    said = capsys.readouterr()
    assert said.err.count("demo: jeat-graph ") == 1
    assert said.err.splitlines()[-1].startswith("jeat-graph track: nowhere.mp4: no such video")
    assert said.out == ""


@pytest.mark.skipif(not os.environ.get("JEAT_GRAPH_FULL"), reason="renders a clip: JEAT_GRAPH_FULL=1")
def test_the_simulated_film_has_both_cameras_side_by_side(tmp_path, monkeypatch):
    monkeypatch.setattr(demo_film, "FRAMES", 8)
    monkeypatch.setattr(demo_film, "SIZE", "160x96")
    monkeypatch.setattr(demo_film, "STILL_AT_S", 0.3)
    commands = demo_film.simulated_commands(tmp_path, "default")
    assert demo_film.make_film(tmp_path, commands) == 0
    assert cv2.imread(str(tmp_path / "film.png")).shape == (96, 2 * 160, 3)
