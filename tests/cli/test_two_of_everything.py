"""Each command that writes for long, started twice on one file: one of the two is refused in a line."""

from __future__ import annotations

import io
import json
import os
import signal
import sys

import pytest

from jeat_graph.cli.main import main
from jeat_graph.io.files.locking import hold_file, hold_folder

pytest.importorskip("fcntl")


def line(k):
    scan = {"t": k / 20, "sensor": "rgb", "boxes": [[100 + 2 * k, 100, 60, 40]], "scores": [0.9]}
    return (json.dumps(scan) + "\n").encode()


def feed(process, numbers):
    """Give lines to a stream and read its answer to each."""
    said = []
    for k in numbers:
        process.stdin.write(line(k))
        process.stdin.flush()
        said.append(json.loads(process.stdout.readline())["t"])
    return said


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("--checkpoint state.npz", "--checkpoint state.npz"),
        ("--checkpoint state.npz", "--checkpoint ./sub/../state.npz"),
        ("--smoothed rows.csv", "--smoothed rows.csv"),
        ("--record record.json", "--record record.json"),
        ("--checkpoint one", "--smoothed one"),
    ],
)
def test_two_streams_never_write_one_file(first, second, start, call, tmp_path):
    (tmp_path / "sub").mkdir()
    first, second = (
        [option, str(tmp_path) + "/" + name] for option, name in (one.split() for one in (first, second))
    )
    process = start("stream", "--image", "1280x720", *first)
    try:
        assert feed(process, range(10)) == [k / 20 for k in range(10)]
        done = call("stream", "--image", "1280x720", *second, given=b"".join(map(line, range(5))))
        assert (done.returncode, done.stdout) == (2, "")
        (complaint,) = done.stderr.splitlines()
        assert "another command is writing it" in complaint
        assert second[1] in complaint
        assert feed(process, range(10, 20)) == [k / 20 for k in range(10, 20)]
        process.stdin.close()
        assert process.wait(timeout=120) == 0
    finally:
        process.kill()
    left = {p.name for p in tmp_path.iterdir()}
    assert not {name for name in left if name.endswith(".lock")}
    done = call("stream", "--image", "1280x720", *first, given=b"".join(map(line, range(20, 25))))
    assert done.returncode == 0


def test_a_stream_that_was_killed_holds_nobody_up(start, call, tmp_path):
    options = ["--image", "1280x720", "--checkpoint", str(tmp_path / "state.npz")]
    process = start("stream", *options)
    try:
        feed(process, range(10))
    finally:
        os.kill(process.pid, signal.SIGKILL)
        process.wait(timeout=60)
    assert (tmp_path / ".state.npz.lock").exists()
    done = call("stream", *options, given=b"".join(map(line, range(25))))
    assert (done.returncode, len(done.stdout.splitlines())) == (0, 25)
    assert [p.name for p in tmp_path.iterdir()] == ["state.npz"]


@pytest.mark.parametrize("other", ["smoothed", "record"])
def test_two_results_of_one_stream_are_two_files(other, tmp_path, monkeypatch, capsys):
    path = str(tmp_path / "one")
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO()))
    assert main(["stream", "--checkpoint", path, f"--{other}", path]) == 2
    assert f"is named by both --checkpoint and --{other}" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


FILES = [
    ("detect", "--frames", "none.mp4", "--out"),
    ("calibrate", "none.csv", "--out"),
    ("camera", "calibrate", "--image", "99x99", "--out"),
    ("count", "none", "--line", "0,0,9,9", "--out"),
    ("eval", "none", "--gt", "none.csv", "--json"),
    ("events", "convert", "none.raw"),
    ("export", "none", "--to", "coco", "--out"),
    ("render", "none", "--out"),
    ("report", "none", "--out"),
    ("train", "frames", "none", "--out"),
]


@pytest.mark.parametrize("command", FILES, ids=lambda command: command[0])
def test_a_file_that_is_being_written_is_refused_before_any_work(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with hold_file("result.csv") as held:
        assert held
        assert main([*command, "result.csv"]) == 2
        (complaint,) = capsys.readouterr().err.splitlines()
        assert complaint.endswith(
            "result.csv: another command is writing it; wait for it, or give another file"
        )
    assert main([*command, "result.csv"]) == 2  # free again: something else is wrong
    assert "another command" not in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "command",
    [
        ("compare", "none"),
        ("road", "none", "--camera", "none.yaml"),
        ("track", "none.csv"),
    ],
    ids=lambda command: command[0],
)
def test_a_folder_that_is_being_written_is_refused(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "none.csv").write_text("t,sensor,left,top,width,height,score\n0,rgb,1,1,9,9,1\n")
    (tmp_path / "run").mkdir()
    with hold_folder(tmp_path / "run"):
        assert main([*command, "--out", "run"]) == 2
    assert "run: another command is writing here" in capsys.readouterr().err
    assert list((tmp_path / "run").iterdir()) == []
