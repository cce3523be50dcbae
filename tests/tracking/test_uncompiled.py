"""The kernels are plain functions on NumPy arrays: without the compiler they give the same bytes."""

import os
import subprocess
import sys

import pytest

SCRIPT = """
import hashlib
import numpy as np
from jeat_graph import Tracker, load_config
from jeat_graph.simulation.scenario import load_scenario
from jeat_graph.simulation.simulate import simulate

import numba

detections, _ = simulate(load_scenario("night"), 3, 0.7)

def causal(preset):
    tracker = Tracker(load_config(preset, ["smoother.engine=none"]))
    digest = hashlib.sha256()
    rows = 0
    for scans in detections.batches():
        table = tracker.step(scans)
        rows += len(table)
        for column in (table.track_id, table.boxes, table.existence, table.mean, table.var, table.used):
            digest.update(np.ascontiguousarray(column).tobytes())
    return bool(numba.config.DISABLE_JIT), rows, digest.hexdigest()
"""
PRESETS = ("highway", "paper")


@pytest.fixture(scope="module")
def plain():
    """Of each preset: whether the compiler was off, rows and digest of the table, in a process without it."""
    script = SCRIPT + "".join(f"\nprint(*causal({preset!r}))" for preset in PRESETS)
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-c", script]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return dict(zip(PRESETS, (line.split() for line in run.stdout.splitlines()), strict=True))


@pytest.mark.parametrize("preset", PRESETS)
def test_compiled_and_plain_kernels_give_the_same_bytes(preset, plain):
    here = {}
    exec(SCRIPT, here)
    off, rows, digest = here["causal"](preset)
    assert not off
    assert plain[preset] == ["True", str(rows), digest]
    assert rows > 100 or preset == "paper"
