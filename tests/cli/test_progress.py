"""Stages show on a terminal and leave nothing in a pipe."""

from __future__ import annotations

import io
import sys
import time

from jeat_graph.cli.progress import stages


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def shown(monkeypatch, stream: io.StringIO) -> str:
    monkeypatch.setattr(sys, "stderr", stream)
    with stages("eval", 2) as stage:
        stage("reading")
        stage("judging")
    return stream.getvalue()


def test_a_terminal_sees_each_stage_and_how_far_it_is(monkeypatch):
    text = shown(monkeypatch, Terminal())
    assert "eval: reading   0%" in text
    assert "eval: judging  50%" in text
    assert "1/2" in text


def test_a_pipe_sees_nothing(monkeypatch):
    assert shown(monkeypatch, io.StringIO()) == ""


def test_the_time_goes_on_within_a_stage(monkeypatch):
    monkeypatch.setattr("jeat_graph.cli.progress._TICK_S", 0.01)
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    with stages("eval", 1) as stage:
        stage("judging")
        drawn = stream.getvalue().count("judging")
        end = time.monotonic() + 100.0
        while stream.getvalue().count("judging") < drawn + 3:
            assert time.monotonic() < end, "nothing moves"
            time.sleep(0.01)
