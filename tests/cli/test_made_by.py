"""`--detector-frames` and its like where boxes come from a file or a pipe: what made them is declared."""

from __future__ import annotations

import io
import json
import sys

import pytest

from jeat_graph.cli.main import main
from jeat_graph.config.reading import load_config
from jeat_graph.detection.declared import known_of_networks
from jeat_graph.io.tables.sensor_columns import as_settings

BOTH = ("--detector-frames", "sehn", "--detector-events", "sehn")
LINES = [f"{k * 0.05:.2f},{name},{100 + 2 * k},200,40,30,0.95" for k in range(30) for name in ("rgb", "evt")]


@pytest.fixture
def boxes(write):
    return write(*LINES)


def of_run(folder):
    return json.loads((folder / "run.json").read_text())["config"]


def test_a_file_of_boxes_is_tracked_as_what_is_known_of_its_networks_says(boxes, tmp_path, capsys):
    out = str(tmp_path / "run")
    assert main(["track", boxes, "--out", out, *BOTH, "--set", "sensors.evt.even_score=0.7"]) == 0
    assert "sehn-frames.tracking.yaml" in capsys.readouterr().err
    found = of_run(tmp_path / "run")["sensors"]
    known = load_config("default", as_settings(known_of_networks({"rgb": "sehn", "evt": "sehn"}))).sensors
    assert found["rgb"]["even_score"] == known["rgb"].even_score is not None
    assert found["evt"]["even_score"] == 0.7, "what the user sets counts over it"


def test_boxes_from_a_pipe_are_taken_for_what_the_same_settings_say(boxes, monkeypatch, capsys):
    networks = {"rgb": "sehn", "evt": "sehn"}
    by_hand = [word for setting in as_settings(known_of_networks(networks)) for word in ("--set", setting)]
    answers = []
    for told in (BOTH, by_hand, ()):
        with open(boxes, "rb") as file:
            monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(file.read())))
        assert main(["stream", "--format", "csv", "--image", "640x384", *told]) == 0
        streamed = capsys.readouterr()
        assert ("sehn-events.tracking.yaml" in streamed.err) == (told is BOTH)
        answers.append(streamed.out)
    assert answers[0] == answers[1] != answers[2]


@pytest.mark.parametrize("command", ["track", "stream"])
def test_what_cannot_be_told_is_one_line(command, boxes, tmp_path, fails):
    begin = ["track", boxes, "--out", str(tmp_path / "run")] if command == "track" else ["stream"]
    assert "paper says it itself" in fails(*begin, *BOTH, "--config", "paper")
    assert "nonsense" in fails(*begin, "--detector-frames", "nonsense")
    bare = str(tmp_path / "bare.onnx")
    assert "--detector-frames: nothing beside the network" in fails(*begin, "--detector-frames", bare)
    assert not (tmp_path / "run").exists()
