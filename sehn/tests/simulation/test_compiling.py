"""The renderer is compiled once, by one process, and it is said before."""

from __future__ import annotations

import subprocess
import sys

import pytest

from jeat_graph_sehn.simulation import compiling
from jeat_graph_sehn.simulation.imaging.event_run import run_physical

# In a process of its own: other tests call kernels with other types.
SCRIPT = """
from jeat_graph_sehn.simulation import compiling
from jeat_graph_sehn.simulation.imaging.event_run import run_physical
from jeat_graph_sehn.simulation.imaging.renderer import paint_all
from jeat_graph_sehn.simulation.imaging.rgb_camera import _expose
from jeat_graph_sehn.simulation.imaging.trace import trace

compiling.render_little()
kernels = run_physical, _expose, paint_all, trace
print(*(len(kernel.overloads) for kernel in kernels))
from jeat_graph.cli.main import main
import sys
main(["simulate", "day", "--sensors", "pictures", "--frames", "2", "--size", "32x32", "--out", sys.argv[1]])
print(*(len(kernel.overloads) for kernel in kernels))
"""


@pytest.mark.skipif(not hasattr(run_physical, "overloads"), reason="nothing is compiled")
def test_a_little_picture_needs_all_that_a_large_one_needs(tmp_path):
    command = [sys.executable, "-c", SCRIPT, str(tmp_path / "clip")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert (lines[0], lines[-1]) == ("1 1 1 1", "1 1 1 1")


@pytest.mark.parametrize(
    ("workers", "compiled", "kept", "said", "rendered"),
    [
        (1, False, "a folder", True, False),
        (2, False, "a folder", True, True),
        (2, False, None, True, False),
        (1, True, "a folder", False, False),
        (2, True, "a folder", False, False),
    ],
)
def test_it_is_compiled_first_where_several_would(
    workers, compiled, kept, said, rendered, monkeypatch, capsys
):
    little = []
    monkeypatch.setattr(compiling, "is_compiled", lambda kernel: compiled)
    monkeypatch.setattr(compiling, "_keeper", lambda kernel: kept)
    monkeypatch.setattr(compiling, "render_little", lambda: little.append(1))
    compiling.prepare_renderer(workers)
    assert (compiling.NOTICE in capsys.readouterr().err) == said
    assert bool(little) == rendered
