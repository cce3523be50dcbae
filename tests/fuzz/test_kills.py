"""A command killed at any moment leaves nothing half written, and the next one takes away what it left."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

FULL = bool(os.environ.get("JEAT_GRAPH_FULL"))
KILLS = 30 if FULL else 1
SEED = 11
# Ctrl-C while Python itself still starts is Python's to answer, with a traceback.
SIGNALS = [signal.SIGKILL, signal.SIGTERM, *([signal.SIGINT] if FULL else [])]
pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
SIMULATE = ("simulate", "night", "--duration", "2", "--out")


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "jeat_graph.cli.main", *map(str, arguments)]


def content(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recording")
    subprocess.run(command(*SIMULATE, folder), check=True, capture_output=True)
    return folder


@pytest.mark.parametrize("number", SIGNALS)
def test_a_run_killed_at_any_moment_leaves_the_earlier_one_and_can_be_repeated(recording, tmp_path, number):
    rng = np.random.default_rng(SEED)
    track = command("track", recording / "detections.csv", "--out", tmp_path / "run", "--smoother", "none")
    begin = time.monotonic()
    subprocess.run(track, check=True, capture_output=True)
    takes = time.monotonic() - begin
    whole = content(tmp_path / "run")
    del whole["run.json"]  # its timings differ
    for _ in range(KILLS):
        process = subprocess.Popen(track, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        time.sleep(float(rng.uniform(0.3, 1.0)) * takes)
        process.send_signal(number)
        said = process.communicate(timeout=60)[1]
        assert number != signal.SIGTERM or "Traceback" not in said
        there = {name: data for name, data in content(tmp_path / "run").items() if "unfinished" not in name}
        assert (there.keys() & whole.keys()) == whole.keys()
        assert all(there[name] == whole[name] for name in whole)
    subprocess.run(track, check=True, capture_output=True)
    after = content(tmp_path / "run")
    del after["run.json"]
    assert after == whole  # nothing is left of those that were killed
