"""`stream` killed at any moment and started again: the same answers and the same smoothed rows."""

from __future__ import annotations

import contextlib
import io
import json
import os
import sys

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.io.tables.detections_io import read_detections


@pytest.fixture(scope="module")
def lines(simulated):
    """A recording as lines in order of arrival: pictures 80 ms late, events 5 ms."""
    detections = read_detections(simulated(1) / "detections.csv")
    late = np.where(np.array(detections.sensors)[detections.scan_sensor] == "rgb", 0.08, 0.005)
    order = np.argsort(detections.scan_t + late, kind="stable")
    scans = [detections.scan(int(k)) for k in order]
    return [
        json.dumps(
            {"t": s.t, "sensor": s.sensor, "boxes": s.boxes.tolist(), "scores": s.scores.tolist()}
        ).encode()
        + b"\n"
        for s in scans
    ]


@pytest.fixture(params=["causal", "lag"])
def identities(request):
    return request.param


def options(folder, identities):
    return [
        *("--smoothed", str(folder / "s.csv"), "--checkpoint", str(folder / "state.npz"), "--every", "0.3"),
        *(
            "--set",
            "smoother.lag_s=0.4",
            "--set",
            f"smoother.identities={identities}",
            "--record",
            str(folder / "record.json"),
        ),
    ]


@pytest.fixture
def to_the_end(lines, identities, monkeypatch, capsys):
    """Run the command over all lines in this process, as nothing is to be killed; answers, complaints."""

    def run(folder):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"".join(lines))))
        capsys.readouterr()
        code = main(["stream", *options(folder, identities)])
        said = capsys.readouterr()
        assert code == 0, f"{said.err}\n{[(p.name, p.stat()) for p in folder.iterdir()]}"
        return said.out.encode().splitlines(), said.err

    return run


def counts_of(folder):
    """The record, but for what says that messages came again."""
    record = json.loads((folder / "record.json").read_text())
    return {key: value for key, value in record.items() if key != "duplicates"}


def killed_after(answers, lines, folder, start, identities):
    """Start it, read so many answers, kill it."""
    folder.mkdir(exist_ok=True)
    process = start("stream", *options(folder, identities))
    try:
        # More than is answered is on its way, so that the kill may come anywhere in a step or a checkpoint.
        writer = os.dup(process.stdin.fileno())
        process.stdin.close()
        os.set_blocking(writer, False)
        text, sent, said = b"".join(lines), 0, []
        while len(said) < answers:
            with contextlib.suppress(BlockingIOError):
                sent += os.write(writer, text[sent : sent + 4096]) if sent < len(text) else 0
            said.append(process.stdout.readline().rstrip(b"\n"))
        process.kill()
        said += process.stdout.read().split(b"\n")[:-1]  # whole lines that were given out before the kill
        os.close(writer)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
        process.stderr.close()
    return said


def test_killed_and_started_again_it_says_and_writes_the_same(
    lines, identities, to_the_end, start, tmp_path, full
):
    whole = tmp_path / "whole"
    whole.mkdir()
    answers, _ = to_the_end(whole)
    assert len(answers) == len(lines)
    rng = np.random.default_rng(4)
    moments = [len(lines) // 2, *rng.integers(1, len(lines) - 8, 50 if full else 0).tolist()]
    for k, moment in enumerate(moments):
        folder = tmp_path / f"killed{k}"
        said = killed_after(moment, lines, folder, start, identities)
        assert said == answers[: len(said)]
        # The input comes again from its beginning: what the checkpoint holds is passed over.
        again, complaints = to_the_end(folder)
        assert again == answers[len(answers) - len(again) :]
        assert len(answers) - len(said) <= len(again) < len(answers)  # nothing is left out in between
        assert (folder / "s.csv").read_bytes() == (whole / "s.csv").read_bytes()
        assert "warning" not in complaints
        assert counts_of(folder) == counts_of(whole)
