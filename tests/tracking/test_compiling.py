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
from jeat_graph.tracking.direct_call import machine_code
from jeat_graph.tracking.warm_up import warm_up

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
        self.part, self.ended = command[-1], False

    def kill(self):
        self.ended = True

    def wait(self):
        assert self.ended


@pytest.mark.parametrize(("cores", "parts"), [(1, []), (2, ["0/1"]), (9, ["0/3", "1/3", "2/3"])])
def test_help_is_asked_for_where_nothing_is_compiled(cores, parts, monkeypatch):
    left = []
    monkeypatch.setattr(compiling, "_helpers", [])
    monkeypatch.setattr(compiling, "is_compiled", lambda function: False)
    monkeypatch.setattr(compiling, "available_cores", lambda: cores)
    monkeypatch.setattr(compiling.subprocess, "Popen", Helper)
    monkeypatch.setattr(compiling.atexit, "register", left.append)
    assert compiling.get_help() == len(parts)
    assert [helper.part for helper in compiling._helpers] == parts
    for end in left:
        end()
    assert all(helper.ended for helper in compiling._helpers)


def test_no_help_is_needed_where_all_is_compiled(monkeypatch):
    monkeypatch.setattr(compiling, "is_compiled", lambda function: True)
    monkeypatch.setattr(compiling.subprocess, "Popen", Helper)
    assert compiling.get_help() == 0


def test_two_processes_that_save_at_once_do_not_write_into_one_file(tmp_path, monkeypatch):
    cache_names.save_under_own_names()
    cache_names.save_under_own_names()  # once is enough
    cache = IndexDataCacheFile(str(tmp_path), "module.kernel-1.py311", "stamp")
    monkeypatch.setattr(cache_names.os, "getpid", lambda: 41)
    cache.save("for integers", "integer code")
    # The other has read the index before that, and saves now.
    monkeypatch.setattr(cache_names.os, "getpid", lambda: 42)
    with monkeypatch.context() as late:
        late.setattr(cache, "_load_index", dict)
        cache.save("for numbers", "number code")
    assert cache.load("for numbers") == "number code"
    assert cache.load("for integers") is None  # lost, and compiled once more
    assert sorted(path.name for path in tmp_path.glob("*.nbc")) == [
        "module.kernel-1.py311.1.41.nbc",
        "module.kernel-1.py311.1.42.nbc",
    ]
