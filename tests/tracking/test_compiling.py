"""Several processes compile the tracker: the same kernels as a step and its smoothers call, each once."""

from __future__ import annotations

import subprocess
import sys

import pytest
from numba.core.caching import IndexDataCacheFile

from jeat_graph.config import cache_names
from jeat_graph.config.reading import load_config
from jeat_graph.tracking import compiling
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

config = load_config("default")
compiling.help_out(0, 1, config)
helped = compiled()
names = [f"{kernel.py_func.__module__}.{kernel.py_func.__qualname__}" for kernel in compiling.stages()]
assert len(names) > 20 and all(helped[name] == 1 for name in names), helped
from jeat_graph.tracking.tracker import Tracker
tracker = Tracker(config)
for k in range(20):
    box = [100.0 + 5.0 * k, 100.0, 40.0, 30.0]
    tracker.step([(0.05 * k, name, [box], [0.9]) for name in tracker.sensor_names])
assert len(tracker.finish())
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


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_stages_are_in_the_order_of_a_step():
    names = [kernel.py_func.__name__ for kernel in compiling.stages()]
    assert (names[0], names[-1]) == ("predict_all", "give_birth")


@pytest.mark.parametrize("number", [1, 2])
def test_each_helper_begins_elsewhere(number, monkeypatch):
    ran = []
    monkeypatch.setattr(compiling, "save_under_own_names", lambda: None)
    monkeypatch.setattr(compiling, "compile_smoothers", lambda config: ran.append("smoothers"))
    monkeypatch.setattr(compiling, "machine_code", lambda kernel, given: ran.append(kernel))
    kernels = compiling.stages()
    compiling.help_out(0, number, load_config("default"))
    assert ran == [*kernels[::-1], "smoothers"]
    ran.clear()
    compiling.help_out(number, number + 1, load_config("default"))
    half = len(kernels) * number // (number + 1)
    assert ran == ["smoothers", *kernels[::-1][half:], *kernels[::-1][:half], "smoothers"]


class Helper:
    def __init__(self, command, **streams):
        assert command[1] == "-P"  # not the folder of the user's files
        self.part, self.ended = command[-1], False

    def kill(self):
        self.ended = True

    def wait(self):
        assert self.ended


@pytest.fixture
def cold(monkeypatch):
    """A process that has compiled nothing; what it does at its end."""
    left = []
    monkeypatch.setattr(compiling, "_helpers", [])
    monkeypatch.setattr(compiling, "is_compiled", lambda function: False)
    monkeypatch.setattr(compiling, "keeper", lambda function: "a folder")
    monkeypatch.setattr(compiling, "save_under_own_names", lambda: None)
    monkeypatch.setattr(compiling.subprocess, "Popen", Helper)
    monkeypatch.setattr(compiling.atexit, "register", left.append)
    return left


@pytest.mark.parametrize(("cores", "parts"), [(1, []), (2, ["0/1"]), (9, ["0/3", "1/3", "2/3"])])
def test_help_is_asked_for_where_nothing_is_compiled(cores, parts, cold, monkeypatch):
    monkeypatch.setattr(compiling, "available_cores", lambda: cores)
    assert compiling.get_help() == len(parts)
    assert [helper.part for helper in compiling._helpers] == parts
    if parts:
        assert compiling.get_help() == 0  # once is enough
    for end in cold:
        end()
    assert all(helper.ended for helper in compiling._helpers)


def test_no_help_is_needed_where_all_is_compiled_or_nothing_kept(cold, monkeypatch):
    monkeypatch.setattr(compiling, "available_cores", lambda: 4)
    with monkeypatch.context() as compiled:
        compiled.setattr(compiling, "is_compiled", lambda function: True)
        assert compiling.get_help() == 0
    monkeypatch.setattr(compiling, "keeper", lambda function: None)
    assert compiling.get_help() == 0


def test_without_more_processes_it_only_takes_longer(cold, monkeypatch):
    def refuse(command, **streams):
        raise BlockingIOError("Resource temporarily unavailable")

    monkeypatch.setattr(compiling, "available_cores", lambda: 4)
    monkeypatch.setattr(compiling.subprocess, "Popen", refuse)
    assert compiling.get_help() == 0


def test_helpers_end_with_who_started_them():
    wait = "from jeat_graph.tracking.compiling import end_with_pipe; end_with_pipe(); time.sleep(600)"
    script = f"import time; {wait}"
    helper = subprocess.Popen([sys.executable, "-c", script], stdin=subprocess.PIPE)
    assert helper.poll() is None
    helper.stdin.close()  # as the system does when a process ends, however it does
    assert helper.wait(timeout=120) == 1


def test_two_processes_that_save_at_once_do_not_write_into_one_file(tmp_path, monkeypatch):
    named = IndexDataCacheFile._data_name
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
