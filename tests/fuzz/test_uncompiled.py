"""The compiled code and the plain Python that it is written in give the same bytes, whatever comes in."""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from jeat_graph.config.reading import load_config, preset_names
from jeat_graph.tracking.tracker import Tracker

from .grammar import stream

FULL = bool(os.environ.get("JEAT_GRAPH_FULL"))
LENGTH, SEEDS, BURST = (300, 8, 20) if FULL else (40, 1, 5)
#: Packages whose compiled functions make the causal and the smoothed table.
PACKAGES = ("jeat_graph.filters", "jeat_graph.association", "jeat_graph.smoothers", "jeat_graph.tracking")
#: What the compiler and NumPy or Python round differently in the last digit.
ROUNDED_OTHERWISE = {"np.exp", "np.expm1", "np.log", "np.log1p", "np.power", "np.sum", "np.mean", "np.dot"}
HERE = Path(__file__)


def digest_of(preset: str, engine: str, seed: int) -> str:
    """Of every number in the causal tables and the smoothed one."""
    steps = stream(seed, tuple(sorted(load_config(preset).sensors)), LENGTH, BURST)
    tracker = Tracker(load_config(preset, [f"smoother.engine={engine}"]))
    tables = [tracker.step(step.scan) for step in steps if not step.bad]
    digest = hashlib.sha256()
    for table in [*tables, tracker.finish()]:
        for values in (table.t, table.track_id, table.boxes, table.existence, table.mean, table.var):
            digest.update(np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()


def digests() -> list[str]:
    """One line a preset, engine and seed."""
    cases = [(preset, "rts", seed) for preset in preset_names() for seed in range(SEEDS)]
    cases += [
        ("default", engine, seed) for engine in ("fixed-lag", "full") for seed in range(SEEDS if FULL else 0)
    ]
    return [f"{preset} {engine} {seed} {digest_of(preset, engine, seed)}" for preset, engine, seed in cases]


@pytest.mark.filterwarnings("ignore::jeat_graph.data.errors.InputWarning")
def test_any_stream_gives_the_same_bytes_without_the_compiler():
    script = (
        f"import sys, warnings; sys.path.insert(0, {str(HERE.parents[1])!r}); "
        "warnings.simplefilter('ignore'); "
        "from fuzz.test_uncompiled import digests; import numba; "
        "print(numba.config.DISABLE_JIT, *digests(), sep='\\n')"
    )
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    off, *plain = done.stdout.splitlines()
    assert off == "1"
    assert plain == digests()


def kernels() -> list[tuple[str, ast.FunctionDef]]:
    """Every compiled function of these packages, and its file."""
    found = []
    for package in PACKAGES:
        spec = importlib.util.find_spec(package)
        assert spec is not None
        for folder in spec.submodule_search_locations or []:
            for path in sorted(Path(folder).rglob("*.py")):
                for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                    if isinstance(node, ast.FunctionDef) and any(
                        "njit" in ast.unparse(decorator) for decorator in node.decorator_list
                    ):
                        found.append((path.name, node))
    return found


def test_kernels_have_nothing_that_the_compiler_rounds_otherwise():
    found = kernels()
    assert len(found) > 50
    strange = [
        f"{file}: {ast.unparse(node)}"
        for file, function in found
        for node in ast.walk(function)
        if (isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow))
        or (isinstance(node, ast.Call) and ast.unparse(node.func) in ROUNDED_OTHERWISE)
    ]
    assert strange == []
