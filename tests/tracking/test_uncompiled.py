"""The kernels are plain functions on NumPy arrays: without the compiler they give the same bytes."""

import os
import subprocess
import sys

import pytest

SCRIPT = """
import hashlib, sys
import numpy as np
from jeat_graph import Tracker, load_config
from jeat_graph.simulation.scenario import load_scenario
from jeat_graph.simulation.simulate import simulate

detections, _ = simulate(load_scenario("night"), 3, 0.7)
tracker = Tracker(load_config(sys.argv[1], ["smoother.engine=none"]))
digest = hashlib.sha256()
rows = 0
for scans in detections.batches():
    table = tracker.step(scans)
    rows += len(table)
    for column in (table.track_id, table.boxes, table.existence, table.mean, table.var, table.used):
        digest.update(np.ascontiguousarray(column).tobytes())
import numba
print(numba.config.DISABLE_JIT, rows, digest.hexdigest())
"""


def causal_digest(preset, **environment):
    """Whether the compiler was off, rows and digest of the causal table of a short recording."""
    run = subprocess.run(
        [sys.executable, "-c", SCRIPT, preset],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    off, rows, digest = run.stdout.split()
    return off, int(rows), digest


@pytest.mark.parametrize("preset", ["highway", "paper"])
def test_compiled_and_plain_kernels_give_the_same_bytes(preset):
    off, rows, plain = causal_digest(preset, NUMBA_DISABLE_JIT="1")
    assert off == "1"
    on, same_rows, compiled = causal_digest(preset, NUMBA_DISABLE_JIT="0")
    assert on == "0"
    assert rows == same_rows
    assert rows > 100 or preset == "paper"
    assert plain == compiled
