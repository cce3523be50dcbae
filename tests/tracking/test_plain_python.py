"""Kernels as plain Python: the same numbers as compiled, to the last bit."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest
from numba import njit

from jeat_graph.tracking.plain_python import plain
from jeat_graph.tracking.reporting import report
from jeat_graph.tracking.step import step

COMPILED = hasattr(step, "overloads")


@njit(cache=True)
def _half(x):
    return 0.5 * x


@njit(cache=True)
def _halves(x, times=2):
    return _half(x) if times == 1 else _halves_again(x, times)


@njit(cache=True)
def _halves_again(x, times):
    return _half(_half(x)) if times == 2 else math.exp(x)


def test_a_plain_kernel_calls_plain_kernels():
    function = plain(_halves)
    assert function(8.0) == 2.0
    assert function(8.0, times=1) == 4.0
    kept = set()

    def check(one):
        if one.__code__ in kept:
            return
        kept.add(one.__code__)
        for name in one.__code__.co_names:
            value = one.__globals__.get(name)
            assert not hasattr(value, "py_func"), name
            if hasattr(value, "__globals__"):
                check(value)

    check(function)
    for kernel in (step, report):
        check(plain(kernel))
    assert len(kept) > 100


def test_the_kernel_itself_stays_as_it_is():
    plain(_halves)
    assert _halves(8.0) == 2.0
    if COMPILED:
        assert len(_halves.overloads) >= 1


def test_what_is_no_kernel_is_plain_already():
    assert plain(math.exp) is math.exp


@njit(cache=True)
def _beyond(name, x):
    if name == 0:
        return math.exp(x)
    if name == 1:
        return math.log(x)
    if name == 2:
        return math.sqrt(x)
    if name == 3:
        return math.log1p(x)
    if name == 4:
        return math.expm1(x)
    return math.pow(x, -1.0)


@pytest.mark.parametrize("name", range(6))
@pytest.mark.parametrize("x", [-np.inf, -1e4, -2.0, -1.0, -0.0, 0.0, 1e-300, 0.3, 1e4, np.inf, np.nan])
def test_functions_give_what_c_gives_where_python_raises_an_error(name, x):
    given = plain(_beyond)(name, x)
    expected = np.array([np.exp, np.log, np.sqrt, np.log1p, np.expm1, np.reciprocal])[name]
    with np.errstate(all="ignore"):
        np.testing.assert_allclose(given, expected(np.float64(x)), rtol=1e-15)
    if COMPILED:
        np.testing.assert_array_equal(given, _beyond(name, x))


# In processes of their own: one that has compiled nothing interprets, and would compile what was forgotten.
SCRIPT = """
import gc, hashlib, math, sys
import numpy as np
from numba.core.dispatcher import Dispatcher
from jeat_graph.config.reading import load_config
from jeat_graph.simulation.scenario import load_scenario
from jeat_graph.simulation.simulate import record
from jeat_graph.tracking import interim, notice
from jeat_graph.tracking.tracker import Tracker

record(load_scenario("night"), 3, 0.1)  # what the simulator needs of these kernels

def compiled():
    return {
        f"{k.py_func.__module__}.{k.py_func.__qualname__}"
        for k in gc.get_objects()
        if isinstance(k, Dispatcher) and k.overloads and k.py_func.__module__.startswith(interim.TRACKER)
    }

if sys.argv[1] == "interpreted":
    notice.when_cold = lambda: None
    interim.begin(interim.Interim(lambda: False))
before = compiled()
for preset, seed in (("default", 1), ("highway", 2), ("paper", 3)):
    found = record(load_scenario("night"), seed, 1.2).detections
    tracker = Tracker(load_config(preset))
    rng = np.random.default_rng(seed)
    for k in range(found.num_scans):
        scan = found.scan(k)
        looks = rng.normal(size=(len(scan.scores), 8)) if preset == "default" else None
        tracker.step((scan.t, scan.sensor, scan.boxes, scan.scores, None, looks))
        if k % 20 == 0:
            tracker.predict(scan.t + 0.02)
    tables = tracker.causal(), tracker.finish()
    assert len(tables[0]) > 3 and len(tables[1]) > 100, preset
    for table in tables:
        for column in (table.t, table.track_id, table.boxes, table.mean, table.var):
            print(preset, hashlib.sha256(np.ascontiguousarray(column).tobytes()).hexdigest())
if sys.argv[1] == "interpreted":
    assert compiled() == before, compiled() - before
"""


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_presets_give_the_same_bytes_compiled_and_interpreted(tmp_path, monkeypatch):
    tables = {}
    for form in ("compiled", "interpreted"):
        with monkeypatch.context() as process:
            if form == "interpreted":
                process.setenv("NUMBA_CACHE_DIR", str(tmp_path))
            command = [sys.executable, "-W", "error", "-c", SCRIPT, form]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        tables[form] = done.stdout.split("\n")
    assert len(tables["compiled"]) > 25
    assert tables["compiled"] == tables["interpreted"]
