"""Processes that compile: who they are, and when they end."""

from __future__ import annotations

import subprocess
import sys

import pytest

from jeat_graph.tracking import helpers


class Helper:
    """A process that does not run."""

    def __init__(self, command, **streams):
        assert command[1] == "-P"  # not the folder of the user's files
        self.command, self.ended = command, False

    def kill(self):
        self.ended = True

    def wait(self):
        assert self.ended


@pytest.fixture
def left(monkeypatch):
    """What is done when the process ends."""
    done = []
    monkeypatch.setattr(helpers, "save_under_own_names", lambda: None)
    monkeypatch.setattr(helpers, "available_cores", lambda: 9)
    monkeypatch.setattr(helpers, "is_compiled", lambda kernel: False)
    monkeypatch.setattr(helpers, "keeper", lambda kernel: "a folder")
    monkeypatch.setattr(helpers.atexit, "register", lambda what, *given: done.append((what, given)))
    monkeypatch.setattr(helpers.subprocess, "Popen", Helper)
    return done


def test_each_is_told_which_one_it_is_and_is_ended_with_who_started_it(left, monkeypatch):
    monkeypatch.setattr(helpers, "end_with_pipe", lambda: None)
    monkeypatch.setattr(helpers.os, "nice", lambda by: None, raising=False)
    started = helpers.start_helpers("some.module", None, most=3)
    assert all(helper.command[:4] == [sys.executable, "-P", "-m", "some.module"] for helper in started)
    assert [helpers.part_of(helper.command[4:]) for helper in started] == [(0, 3), (1, 3), (2, 3)]
    for what, given in left:
        what(*given)
    assert all(helper.ended for helper in started)


def test_who_is_not_told_is_none():
    assert helpers.part_of([]) is None
    assert helpers.part_of(["track", "--help-out"]) is None


def test_without_more_processes_it_only_takes_longer(left, monkeypatch):
    def refuse(command, **streams):
        raise BlockingIOError("Resource temporarily unavailable")

    monkeypatch.setattr(helpers.subprocess, "Popen", refuse)
    assert helpers.start_helpers("some.module", None, most=2) == []


def test_they_end_with_who_started_them():
    wait = "from jeat_graph.tracking.helpers import end_with_pipe; end_with_pipe(); time.sleep(600)"
    script = f"import time; {wait}"
    helper = subprocess.Popen([sys.executable, "-c", script], stdin=subprocess.PIPE)
    assert helper.poll() is None
    helper.stdin.close()  # as the system does when a process ends, however it does
    assert helper.wait(timeout=120) == 1
