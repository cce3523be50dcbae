"""Several processes compile the tracker: the same kernels as a step and its smoothers call, each once."""

from __future__ import annotations

import math
import subprocess
import sys
from types import SimpleNamespace

import pytest
from numba.core.caching import IndexDataCacheFile

from jeat_graph.config import cache_names
from jeat_graph.tracking import compiling, helpers
from jeat_graph.tracking.step import step

COMPILED = hasattr(step, "overloads")

# All in a process of its own: other tests call kernels with types that a step has not.
SCRIPT = """
import gc
from numba.core.dispatcher import Dispatcher
from jeat_graph.config.reading import load_config
from jeat_graph.tracking import compiling

def compiled():
    found = {}
    for kernel in gc.get_objects():
        if isinstance(kernel, Dispatcher) and kernel.py_func.__module__.startswith("jeat_graph"):
            found[f"{kernel.py_func.__module__}.{kernel.py_func.__qualname__}"] = len(kernel.overloads)
    return found

compiling.help_out(1, 2)
helped = compiled()
names = [f"{kernel.py_func.__module__}.{kernel.py_func.__qualname__}" for kernel in compiling.stages()]
assert len(names) > 20 and all(helped[name] == 1 for name in names), helped
both = load_config("default")
compiling.compile_all([both, compiling.of_one_sensor(both)])
after = compiled()
new = {name: count for name, count in after.items() if count != helped.get(name, 0)}
print(*(name for name in new if name in names or "smooth" in name), sep="\\n")
assert "jeat_graph.tracking.step.step" in new
"""


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_what_helpers_compile_is_what_the_tracker_calls():
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == []


# What a run by one detector, by two and by the paper's filter calls of the smoothers is there.
SMOOTHED = """
from jeat_graph.smoothers.backward import smooth_covs
from jeat_graph.tracking import compiling
compiling.compile_all()
print(*sorted(len(types[0]) for types in smooth_covs.signatures))
"""


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_smoothers_are_compiled_for_one_sensor_too():
    done = subprocess.run([sys.executable, "-c", SMOOTHED], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["3", "4", "5"]


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_stages_are_in_the_order_of_a_step():
    names = [kernel.py_func.__name__ for kernel in compiling.stages()]
    assert (names[0], names[-1]) == ("predict_all", "give_birth")


def test_each_helper_begins_elsewhere(monkeypatch):
    ran = []
    monkeypatch.setattr(compiling, "compile_smoothers", lambda config: ran.append("smoothers"))
    monkeypatch.setattr(compiling, "compile_all", lambda: ran.append("all"))
    monkeypatch.setattr(compiling, "begin", lambda interim: ran.append("begin"))
    monkeypatch.setattr(compiling, "end", lambda: ran.append("end"))
    monkeypatch.setattr(compiling, "machine_code", lambda kernel, given: ran.append(kernel))
    kernels = compiling.stages()
    _, second, last = (len(kernels) * k // 3 for k in range(3))
    for k, expected in enumerate(
        (
            [*kernels[::-1], "begin", "all", "end", "all"],
            [*kernels[::-1][second:], *kernels[::-1][:second]],
            ["smoothers", "smoothers", *kernels[::-1][last:], *kernels[::-1][:last]],
        )
    ):
        ran.clear()
        compiling.help_out(k, 3)
        assert ran == expected


class Helper:
    """A process that compiles until it is told that it has done so."""

    ended = None

    def poll(self):
        return self.ended


@pytest.fixture
def cold(monkeypatch, tmp_path):
    """A process that has compiled nothing; which modules it has had run by how many helpers."""
    asked = []

    class Started(Helper):
        def __init__(self, command, **streams):
            asked.append(command[3])

    monkeypatch.setattr(compiling, "_helpers", [])
    monkeypatch.setattr(helpers.subprocess, "Popen", Started)
    monkeypatch.setattr(helpers, "save_under_own_names", lambda: None)
    monkeypatch.setattr(compiling.atexit, "register", lambda *given: None)
    for module in (compiling, helpers):
        monkeypatch.setattr(module, "is_compiled", lambda function: False)
        monkeypatch.setattr(module, "keeper", lambda function: SimpleNamespace(_cache_path=tmp_path))
    return asked


@pytest.mark.parametrize(("cores", "number"), [(1, 0), (2, 1), (3, 2), (9, 3)])
def test_help_is_asked_for_where_nothing_is_compiled(cores, number, cold, monkeypatch):
    monkeypatch.setattr(helpers, "available_cores", lambda: cores)
    assert compiling.get_help() == number
    assert cold == ["jeat_graph.tracking.warm_up"] * number
    if number:
        assert compiling.get_help() == 0  # once is enough
        assert len(cold) == number


def test_no_help_is_needed_where_all_is_compiled_or_nothing_kept(cold, monkeypatch):
    monkeypatch.setattr(helpers, "available_cores", lambda: 4)
    with monkeypatch.context() as compiled:
        compiled.setattr(helpers, "is_compiled", lambda function: True)
        assert compiling.get_help() == 0
    monkeypatch.setattr(helpers, "keeper", lambda function: None)
    assert compiling.get_help() == 0
    assert not cold


@pytest.mark.parametrize(
    ("cores", "live", "patient"), [(2, False, False), (2, True, True), (1, False, False), (1, True, False)]
)
def test_only_what_is_live_and_has_help_is_interpreted_for_as_long_as_it_takes(
    cores, live, patient, cold, monkeypatch, capsys
):
    begun = []
    monkeypatch.setattr(helpers, "available_cores", lambda: cores)
    monkeypatch.setattr(compiling, "Interim", lambda *given: given)
    monkeypatch.setattr(compiling, "begin", begun.append)
    compiling.work_meanwhile(live)
    ((is_over, patience_s, _),) = begun
    assert (patience_s() == math.inf) is patient
    assert not is_over()
    assert "not compiled for this machine yet" in capsys.readouterr().err
    if cores > 1:
        compiling._helpers[0].ended = 1  # it has failed: nobody compiles
        assert not is_over()
        assert patience_s() == compiling._PATIENCE_S
        compiling._helpers[0].ended = 0
        assert is_over()


def test_many_short_runs_are_patient_for_as_long_as_one(cold, monkeypatch, capsys):
    left, begun = [], []
    monkeypatch.setattr(helpers, "available_cores", lambda: 2)
    monkeypatch.setattr(compiling, "begin", begun.append)
    monkeypatch.setattr(compiling.atexit, "register", lambda what, *given: left.append(what))
    for run in range(3):
        compiling._helpers.clear()
        compiling.work_meanwhile(live=False)
        assert ("is not compiled" in capsys.readouterr().err) is (run < 2)  # then it is compiled at once
        if run < 2:
            begun[-1]._spent_s = 0.6 * compiling._PATIENCE_S
            left.pop()()
    assert len(begun) == 2
    assert begun[1]._patience_s() == pytest.approx(0.4 * compiling._PATIENCE_S)
    compiling.work_meanwhile(live=True)  # who is live is patient all the same
    assert len(begun) == 3
    monkeypatch.setattr(compiling, "is_compiled", lambda function: True)
    compiling._note_spent(3.0)
    assert compiling._spent_before() == 0.0


def test_what_was_spent_is_forgotten_with_what_was_compiled(cold, tmp_path, monkeypatch):
    from jeat_graph.config.stale_kernels import _remove

    kept = tmp_path / "__pycache__"
    kept.mkdir()
    monkeypatch.setattr(compiling, "keeper", lambda function: SimpleNamespace(_cache_path=kept))
    compiling._note_spent(3.0)
    assert compiling._spent_before() == 3.0
    _remove(str(tmp_path / "step.py"), None)
    assert compiling._spent_before() == 0.0


@pytest.mark.parametrize("compiled", [False, True])
def test_a_short_process_interprets_what_is_not_compiled(compiled, cold, monkeypatch, capsys):
    begun = []
    monkeypatch.setattr(compiling.notice, "_said", set())
    monkeypatch.setattr(compiling.notice, "when_cold", None)
    monkeypatch.setattr(compiling.notice, "is_compiled", lambda function: compiled)
    monkeypatch.setattr(compiling, "begin", begun.append)
    compiling.do_without()
    assert len(begun) == (not compiled)
    assert ("not compiled for this machine yet" in capsys.readouterr().err) is not compiled
    assert not cold


def test_two_processes_that_save_at_once_do_not_write_into_one_file(tmp_path, monkeypatch):
    named = IndexDataCacheFile._data_name
    named = getattr(named, "__wrapped__", named)  # another test may have had this process save under its name
    cache = IndexDataCacheFile(str(tmp_path), "module.kernel-1.py311", "stamp")
    for what, index in (("integer", None), ("number", {})):
        with monkeypatch.context() as process:
            process.setattr(IndexDataCacheFile, "_data_name", named)
            cache_names.save_under_own_names()
            cache_names.save_under_own_names()  # once is enough
            if index is not None:  # the second has read the index before the first saved
                process.setattr(cache, "_load_index", lambda index=index: dict(index))
            cache.save(f"for {what}s", f"{what} code")
    assert cache.load("for numbers") == "number code"
    assert cache.load("for integers") is None  # lost, and compiled once more
    assert len({path.name for path in tmp_path.glob("module.kernel-1.py311.1.*.nbc")}) == 2
