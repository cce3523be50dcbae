"""The smoothers run without the compiler too, and agree with their compiled form but for last digits."""

import os
import subprocess
import sys

import numba
import numpy as np
import pytest

SCRIPT = """
import numpy as np
from jeat_graph import Tracker, load_config

rng = np.random.default_rng(0)
left = 100.0 + 2.0 * np.arange(60) + rng.normal(size=60)
columns = {}
for engine in ("fixed-lag", "fixed-lag-rts", "rts", "full"):
    tracker = Tracker(load_config("default", [f"smoother.engine={engine}"]))
    for k in range(60):
        tracker.step((0.05 * k, "rgb" if k % 2 else "evt", [[left[k], 100, 40, 30]], [0.9]))
    table = tracker.finish()
    columns[f"{engine} mean"], columns[f"{engine} var"] = table.mean, table.var
"""


@pytest.mark.slow
def test_uncompiled_smoothers_agree_with_compiled_ones(tmp_path):
    environment, path = {**os.environ, "NUMBA_DISABLE_JIT": "1"}, tmp_path / "plain.npz"
    script = f"{SCRIPT}\nnp.savez({str(path)!r}, **columns)"
    subprocess.run([sys.executable, "-c", script], env=environment, check=True)
    plain, here = dict(np.load(path)), {}
    assert not numba.config.DISABLE_JIT
    exec(SCRIPT, here)
    compiled = here["columns"]
    assert compiled.keys() == plain.keys()
    for name, column in compiled.items():
        assert len(column) > 50
        # Sums in another order: some roundings of the largest numbers, 1e3 px and px/s.
        assert np.allclose(column, plain[name], rtol=1e-9, atol=1e-9), name
