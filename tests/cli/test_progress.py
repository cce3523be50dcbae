"""Stages show on a terminal and leave nothing in a pipe."""

from __future__ import annotations

import argparse
import io
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from jeat_graph.cli import report_command
from jeat_graph.cli.detect_command import detect_with_bar
from jeat_graph.cli.main import main
from jeat_graph.cli.progress import stages
from jeat_graph.cli.terminal import in_good_order
from jeat_graph.data.events import EventArray
from jeat_graph.data.progress import progress_to, with_progress, write_line
from jeat_graph.detection.detecting import detect_files
from jeat_graph.detection.request import DetectRequest
from jeat_graph.detection.summary import summarise
from jeat_graph.drawing.page.document import render_page
from jeat_graph.eval.compare import compare
from jeat_graph.io.events.evt3_writer import Evt3Writer
from jeat_graph.io.events.opening import open_events
from jeat_graph.io.media.video_writer import FrameWriter
from jeat_graph.io.tables.truth_io import read_truth
from jeat_graph.runs.measured import measured_run
from jeat_graph.runs.recorded import load_run_data


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def wait_until(happened: Callable[[], bool]) -> None:
    """Wait for something that another thread does."""
    end = time.monotonic() + 100.0
    while not happened():
        assert time.monotonic() < end, "nothing moves"
        time.sleep(0.005)


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


def test_the_percentage_moves_within_a_stage(monkeypatch):
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr("jeat_graph.data.progress._TICK_S", 0.001)
    with stages("eval", 2) as stage:
        stage("reading")
        stage("judging")
        for k in with_progress(range(4)):
            if k == 2:
                wait_until(lambda: "eval: judging  75%" in stream.getvalue())
    assert "100%" not in stream.getvalue().split("judging  75%")[0]


def moves(work: Callable[[], object]) -> list[float]:
    """What a piece of work tells of its progress."""
    shares: list[float] = []
    with progress_to(shares.append):
        work()
    assert shares == sorted(shares)
    return sorted(set(shares))


def test_judging_and_comparing_tell_how_far_they_are(recording, small_plots, tmp_path):
    run = tmp_path / "run"
    truth = str(recording / "gt.csv")
    assert main(["track", str(recording / "detections.csv"), "--out", str(run)]) == 0
    assert len(moves(lambda: load_run_data(run, truth))) >= 8
    assert len(moves(lambda: render_page(load_run_data(run)))) > 10  # as many as there are tracks
    measured = measured_run(run)
    known = read_truth(truth)
    compared = moves(
        lambda: compare(
            measured.tracks, measured.sensors, truth=known, causal=measured.causal, lags_s=(0.0, 0.1)
        )
    )
    assert len(compared) > len(measured.tracks)
    assert len(moves(lambda: measured_run(run))) >= 60  # tracked again: as many as there were steps
    with small_plots():
        assert len(moves(lambda: _compare(run, truth))) > len(measured.tracks)  # as `report` does it


def _compare(run: Path, truth: str) -> object:
    arguments = argparse.Namespace(
        no_compare=False,
        run_directory=str(run),
        detections=None,
        gt=truth,
        rate=None,
        first_frame=None,
        only_video=None,
        class_names=None,
        image=None,
    )
    return report_command._compare(arguments)


def test_a_pipe_sees_nothing(monkeypatch):
    assert shown(monkeypatch, io.StringIO()) == ""


def test_the_time_goes_on_within_a_stage(monkeypatch):
    monkeypatch.setattr("jeat_graph.data.progress._TICK_S", 0.01)
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    with stages("eval", 1) as stage:
        stage("judging")
        drawn = stream.getvalue().count("judging")
        wait_until(lambda: stream.getvalue().count("judging") >= drawn + 3)


def test_detecting_in_pictures_tells_how_many_have_been_looked_at(tmp_path, monkeypatch):
    with FrameWriter(tmp_path, "lossless", (64, 48), 20.0) as writer:
        for k in range(8):
            writer.append(50_000 * k, np.full((48, 64, 3), 20 + k, dtype=np.uint8))
    request = DetectRequest(frames=str(tmp_path / "frames.avi"))
    assert moves(lambda: detect_files(request)) == pytest.approx([k / 8 for k in range(9)])
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    detect_with_bar(request, "detect")
    assert "detect:   0%|" in stream.getvalue()


def test_reading_a_file_of_events_shows_how_many_there_are(tmp_path, monkeypatch, capsys):
    t = np.arange(0, 500_000, 100)
    x = (t % 64).astype(np.uint16)
    with Evt3Writer(tmp_path / "e.raw", (64, 48)) as writer:
        writer.append(EventArray(t, x, x % 48, (x % 2).astype(np.uint8)))
    with open_events(tmp_path / "e.raw") as reader:
        seen: list[int] = []
        assert summarise(reader, seen.append).events == sum(seen) == len(t)
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    assert main(["events", "info", str(tmp_path / "e.raw")]) == 0
    assert "events: " in stream.getvalue()


def on_screen(text: str) -> list[str]:
    """Lines as a terminal shows them in the end: a carriage return goes back over the line."""
    lines = []
    for line in text.split("\n"):
        shown = ""
        for piece in line.split("\r"):
            shown = piece + shown[len(piece) :]
        lines.append(shown.rstrip())
    return lines


@pytest.mark.parametrize("loaded", [True, False])
def test_what_is_said_while_a_bar_stands_there_has_a_line_of_its_own(loaded, monkeypatch):
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    if loaded:
        with stages("eval", 1) as stage:
            stage("judging")
            write_line("jeat-graph eval: warning: first")
    else:
        monkeypatch.delitem(sys.modules, "tqdm")
        write_line("jeat-graph eval: warning: first")
    assert "jeat-graph eval: warning: first" in on_screen(stream.getvalue())


def test_a_warning_of_the_library_goes_beside_the_bar_too(monkeypatch):
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    with in_good_order("track"), stages("track", 1) as stage:
        stage("tracking")
        warnings.simplefilter("always")
        warnings.warn("boxes look odd", UserWarning, stacklevel=1)
    assert "jeat-graph track: warning: boxes look odd" in on_screen(stream.getvalue())
