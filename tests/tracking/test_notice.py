"""Who waits for the compiler is told so, once for each thing that is compiled."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import pytest

from jeat_graph.tracking import notice


@pytest.fixture
def unsaid(monkeypatch):
    """A process that has said nothing yet."""
    monkeypatch.setattr(notice, "_said", set())


def compiled_function(folder):
    """What is needed of a function that the compiler keeps in a folder."""
    return SimpleNamespace(
        stats=SimpleNamespace(cache_path=str(folder)), __module__="package.painter", __name__="paint"
    )


def test_code_of_this_python_counts_and_no_other(tmp_path):
    paint = compiled_function(tmp_path)
    assert not notice.is_compiled(paint)
    (tmp_path / "painter.paint-12.py27.nbi").touch()
    (tmp_path / "painter.other-12.py311.nbi").touch()
    assert not notice.is_compiled(paint)
    (tmp_path / f"painter.paint-12.py{sys.version_info.major}{sys.version_info.minor}.nbi").touch()
    assert notice.is_compiled(paint)


def test_without_the_compiler_nothing_is_waited_for():
    assert notice.is_compiled(lambda: None)


def test_each_thing_is_named_once(tmp_path, unsaid, capsys):
    for _ in range(2):
        notice.notice_if_cold(compiled_function(tmp_path), "the renderer")
        notice.notice_if_cold(compiled_function(tmp_path), "the painter")
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
