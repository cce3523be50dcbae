"""Who waits for the compiler is told so, once for each thing that is compiled."""

from __future__ import annotations

import subprocess
import sys
from types import SimpleNamespace

import pytest

from jeat_graph.tracking import notice


@pytest.fixture
def unsaid(monkeypatch):
    """A process that has said nothing yet."""
    monkeypatch.setattr(notice, "_said", set())
    monkeypatch.setattr(notice, "when_cold", None)


class Kept:
    """What numba keeps of a function: the keys of its index."""

    def __init__(self, *keys):
        self.keys = keys

    def _load_index(self):
        return dict.fromkeys(self.keys, "file")


MACHINE = ("x86_64", "a processor", "+avx2")


def kernel(*machines, kept=True):
    """What is needed of a function that was compiled for these machines."""
    return SimpleNamespace(
        stats=None,
        targetctx=SimpleNamespace(codegen=lambda: SimpleNamespace(magic_tuple=lambda: MACHINE)),
        _cache=SimpleNamespace(_cache_file=Kept(*(("types", machine, "source") for machine in machines)))
        if kept
        else SimpleNamespace(),
    )


def test_code_for_this_machine_counts_and_no_other():
    assert notice.is_compiled(kernel(MACHINE))
    assert notice.is_compiled(kernel(("arm64", "another", ""), MACHINE))
    assert not notice.is_compiled(kernel(("arm64", "another", "")))
    assert not notice.is_compiled(kernel())
    assert not notice.is_compiled(kernel(kept=False))


def test_it_is_as_the_compiler_has_it():
    """A real kernel, and the compiler's own word on whether it found its code on disk."""
    done = subprocess.run([sys.executable, "-c", REAL], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True", "False"]


REAL = """
import os, sys, tempfile
folder = tempfile.mkdtemp()
os.environ["NUMBA_CACHE_DIR"] = folder
sys.path.insert(0, folder)
with open(os.path.join(folder, "kept.py"), "w") as file:
    file.write("from numba import njit\\n@njit(cache=True)\\ndef f(x):\\n    return x + 1\\n")
from jeat_graph.tracking.notice import is_compiled, keeper
import kept
print(is_compiled(kept.f))
kept.f(1)
print(is_compiled(kept.f))
keeper(kept.f)._version = "of another numba"
print(is_compiled(kept.f))
"""


def test_without_the_compiler_nothing_is_waited_for():
    assert notice.is_compiled(lambda: None)


def test_each_thing_is_named_once(unsaid, capsys):
    for _ in range(2):
        notice.notice_if_cold(kernel(), "the renderer")
        notice.notice_if_cold(kernel(), "the painter")
    lines = capsys.readouterr().err.splitlines()
    assert [line.split(" for this machine")[0] for line in lines] == [
        "jeat-graph: compiling the renderer",
        "jeat-graph: compiling the painter",
    ]


def test_a_tracker_says_so_from_python_too(unsaid, capsys, monkeypatch):
    from jeat_graph import Tracker

    monkeypatch.setattr(notice, "is_compiled", lambda _: False)
    Tracker()
    Tracker()
    assert capsys.readouterr().err.count("jeat-graph: compiling the tracker for this machine, once") == 1


def test_the_command_line_is_asked_instead(unsaid, capsys, monkeypatch):
    asked = []
    monkeypatch.setattr(notice, "is_compiled", lambda _: False)
    monkeypatch.setattr(notice, "when_cold", lambda: asked.append(1))
    for _ in range(2):
        notice.notice_if_cold()
        notice.notice_if_cold(kernel(), "the renderer")
    assert asked == [1]
    assert [line.split()[2:4] for line in capsys.readouterr().err.splitlines()] == [["the", "renderer"]]
