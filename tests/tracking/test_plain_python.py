"""Kernels as plain Python: the same numbers as compiled, to the last bit."""

from __future__ import annotations

import ast
import inspect
import math
import subprocess
import sys
import textwrap

import numpy as np
import pytest
from numba import njit

from jeat_graph.association.densities import log_constants
from jeat_graph.tracking.interim import TRACKER
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


def reached(*functions):
    """Functions that these call by their names, directly or not, and they themselves."""
    found, waiting = {}, list(functions)
    while waiting:
        one = waiting.pop()
        if one.__code__ not in found:
            found[one.__code__] = one
            called = (one.__globals__.get(name) for name in one.__code__.co_names)
            waiting += [value for value in called if hasattr(value, "__globals__")]
    return list(found.values())


def test_a_plain_kernel_calls_plain_kernels():
    function = plain(_halves)
    assert function(8.0) == 2.0
    assert function(8.0, times=1) == 4.0
    functions = reached(function, plain(step), plain(report))
    assert len(functions) > 100
    for one in functions:
        for name in one.__code__.co_names:
            assert not hasattr(one.__globals__.get(name), "py_func"), name


def kernels_of_a_tracker():
    """All kernels that trackers and smoothers call; each as plain Python."""
    import jeat_graph.tracking.compiling  # imports all of them

    modules = [module for name, module in sys.modules.items() if name.startswith(TRACKER)]
    assert jeat_graph.tracking.compiling in modules
    return [one.py_func for module in modules for one in vars(module).values() if hasattr(one, "py_func")]


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_kernels_leave_no_order_of_sums_to_a_library():
    """What NumPy adds in pairs, and a BLAS as it likes, has other last bits than a loop."""
    kernels = kernels_of_a_tracker()
    assert len(kernels) > 200
    for kernel in kernels:
        for node in ast.walk(ast.parse(textwrap.dedent(inspect.getsource(kernel)))):
            assert not isinstance(node, ast.MatMult), kernel
            called = getattr(node.func, "attr", "") if isinstance(node, ast.Call) else ""
            assert called not in {"sum", "mean", "dot", "prod", "var", "std", "solve", "inv", "cholesky"}, (
                kernel
            )


def test_the_gamma_function_is_that_of_the_c_library():
    freedom = np.arange(3.0, 60.0)
    for dims in (1, 2):
        ours = [plain(log_constants)(f)[dims] for f in freedom]
        np.testing.assert_array_equal(ours, [log_constants(f)[dims] for f in freedom])


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
from jeat_graph_sehn.simulation.scenario import load_scenario
from jeat_graph_sehn.simulation.simulate import record
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
third = ["sensors.thermal={rate_hz: 20}"]
heavy = ["association.tail_freedom=5"]
cases = ("default", []), ("default", third), ("default", heavy), ("highway", []), ("paper", [])
for seed, (preset, changes) in enumerate(cases):
    found = record(load_scenario("night"), seed, 1.2).detections
    tracker = Tracker(load_config(preset, changes))
    rng = np.random.default_rng(seed)
    for k in range(found.num_scans):
        scan = found.scan(k)
        looks = rng.normal(size=(len(scan.scores), 8)) if seed == 0 else None
        scans = [(scan.t, scan.sensor, scan.boxes, scan.scores, None, looks)]
        if changes is third and scan.sensor == "rgb":
            shifted = scan.boxes + rng.normal(size=scan.boxes.shape) ** 2
            scans.append((scan.t, "thermal", shifted, scan.scores))
        tracker.step(scans)
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
    assert len(tables["compiled"]) > 50
    assert tables["compiled"] == tables["interpreted"]
