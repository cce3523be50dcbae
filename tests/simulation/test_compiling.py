"""A second process compiles the renderer from the other end."""

from __future__ import annotations

import subprocess
import sys

import pytest

from jeat_graph.simulation import compiling
from jeat_graph.simulation.imaging.event_run import run_physical
from jeat_graph.tracking import helpers as processes

# In a process of its own: other tests call kernels with other types.
SCRIPT = """
from jeat_graph.simulation import compiling
from jeat_graph.simulation.imaging.event_run import run_physical
from jeat_graph.simulation.imaging.renderer import paint_all
from jeat_graph.simulation.imaging.rgb_camera import _expose
from jeat_graph.simulation.imaging.trace import trace
from jeat_graph.tracking import interim

compiling.help_out()
kernels = run_physical, _expose, paint_all, trace
print(*(len(kernel.overloads) for kernel in kernels))
interim.end()
from jeat_graph.cli.main import main
import sys
main(["simulate", "day", "--sensors", "pictures", "--frames", "2", "--size", "32x32", "--out", sys.argv[1]])
print(*(len(kernel.overloads) for kernel in kernels))
"""


@pytest.mark.skipif(not hasattr(run_physical, "overloads"), reason="nothing is compiled")
def test_it_compiles_what_comes_last_as_who_renders_calls_it(tmp_path):
    command = [sys.executable, "-c", SCRIPT, str(tmp_path / "clip")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert (lines[0], lines[-1]) == ("1 1 0 0", "1 1 1 1")


@pytest.mark.parametrize(
    ("alone", "cores", "compiled", "kept", "helpers"),
    [
        (True, 2, False, "a folder", 1),
        (True, 16, False, "a folder", 1),
        (False, 2, False, "a folder", 0),
        (True, 1, False, "a folder", 0),
        (True, 2, True, "a folder", 0),
        (True, 2, False, None, 0),
    ],
)
def test_help_is_asked_for_where_it_helps(alone, cores, compiled, kept, helpers, monkeypatch):
    asked = []
    monkeypatch.setattr(compiling, "notice_if_cold", lambda function, what: None)
    monkeypatch.setattr(processes, "available_cores", lambda: cores)
    monkeypatch.setattr(processes, "is_compiled", lambda function: compiled)
    monkeypatch.setattr(processes, "keeper", lambda function: kept)
    monkeypatch.setattr(processes, "save_under_own_names", lambda: None)
    monkeypatch.setattr(processes.subprocess, "Popen", lambda command, **streams: asked.append(command[3]))
    monkeypatch.setattr(processes.atexit, "register", lambda *given: None)
    compiling.prepare_renderer(alone)
    assert asked == ["jeat_graph.simulation.compiling"] * helpers
