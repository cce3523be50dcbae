"""`stream` with wrong times in its input: answers, smoothed rows, and what a saved state makes of it."""

from __future__ import annotations

import io
import json
import sys

import pytest

from jeat_graph.cli.main import main

WAYS = [("--late", "rewind"), ("--late", "skip"), ("--late", "refuse")]


def scan(t, sensor):
    boxes = [[100 + 40 * (t % 20.0), 100, 60, 40]]
    return {"t": round(t, 4), "sensor": sensor, "boxes": boxes, "scores": [0.9]}


def messages(begin, count, jump_s=0.0):
    """Lines of two sensors, one a moment; the vehicle where it is at that moment."""
    lines = []
    for k in range(count):
        both = [scan(begin + k * 0.05, sensor) for sensor in ("evt", "rgb")]
        lines.append(json.dumps([one | {"t": one["t"] + jump_s} for one in both]) + "\n")
    return lines


@pytest.fixture
def stream(monkeypatch, capsys):
    """Run the command over lines: its answers and what it complained of."""

    def run(lines, *options, code=0):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO("".join(lines).encode())))
        capsys.readouterr()
        assert main(["stream", "--image", "1280x720", *map(str, options)]) == code
        said = capsys.readouterr()
        return [json.loads(line) for line in said.out.splitlines()], said.err

    return run


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way[1])
@pytest.mark.parametrize("jump_s", [1e9, 60.0, -1e9])
def test_one_message_of_two_sensors_with_a_wrong_time_changes_nothing(stream, jump_s, way, tmp_path):
    if jump_s < 0.0 and way[1] == "refuse":
        pytest.skip("a scan that is late is an error there")
    before, after, wrong = messages(0.0, 40), messages(2.0, 200), messages(2.0, 1, jump_s)
    right, _ = stream(before + after, *way, "--smoothed", tmp_path / "right.csv")
    found, complaint = stream(before + wrong + after, *way, "--smoothed", tmp_path / "found.csv")
    assert found == right
    assert len(right) == 240
    assert (tmp_path / "found.csv").read_bytes() == (tmp_path / "right.csv").read_bytes()
    assert f"gave the time {2.0 + jump_s:.3f} s, which no other scan confirms" in complaint


@pytest.mark.parametrize(("count", "lost"), [(1, 0), (3, 3), (40, 100)])
def test_after_a_restart_from_a_state_with_a_wrong_time_it_goes_on(stream, count, lost, tmp_path):
    options = ("--checkpoint", tmp_path / "state.npz", "--smoothed", tmp_path / "rows.csv")
    stream(messages(0.0, 40) + messages(2.0, count, 1e9), *options)
    answers, complaint = stream(messages(2.0, 200), *options)
    assert len(answers) == 200 - lost
    assert answers[-1]["t"] == pytest.approx(11.95)
    assert [one["box"] for one in answers[-1]["tracks"]] == [
        pytest.approx([578.0, 100.0, 60.0, 40.0], abs=1.0)
    ]
    assert ("a clock was set back" in complaint) == (count > 1)


def test_of_what_is_refused_in_a_row_is_told_again_and_again(stream):
    """The stream goes on at a time of which the clock was set back, and late scans are refused."""
    lines = messages(1000.0, 20) + messages(0.0, 1000)
    answers, complaint = stream(lines, "--late", "refuse", "--on-error", "skip")
    assert len(answers) == 20
    told = [line for line in complaint.splitlines() if "were all passed over" in line]
    assert [line.split("the last ")[1].split()[0] for line in told] == ["100", "200", "400", "800"]
    assert "is older than the last one at 1000.95 s" in told[-1]
