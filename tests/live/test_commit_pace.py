"""How often what was taken is confirmed to a broker: a fast source writes no storm of checkpoints."""

from __future__ import annotations

import io
import json

import pytest

from jeat_graph import Tracker, load_config
from jeat_graph.cli import stream_command
from jeat_graph.io.streams.stream_reading import StreamReading
from jeat_graph.live.commit_pace import CommitPace
from jeat_graph.live.late import LiveTracker
from jeat_graph.live.service.config import read_service
from jeat_graph.live.service.ends import OpenedSource
from jeat_graph.live.service.log import Log
from jeat_graph.live.service.run import Service, _Running
from jeat_graph.live.service.status import EndStatus
from jeat_graph.live.session import Ends, Session
from jeat_graph.live.session_warnings import BadLines
from jeat_graph.live.transport.notices import Notices


class Source:
    """Gives numbered scans at a rate, by a clock of its own, and no more than may be open.

    Args:
        hz: messages in a second.
        most_open: what it tells of itself.
        gives: what it gives of them at most without a commit.
        garbage: whether all are messages that cannot be read.
    """

    address = "fake"

    def __init__(self, hz, most_open, gives=None, garbage=False):
        self.hz, self.most_open, self.gives, self.garbage = hz, most_open, gives or most_open, garbage
        self.now = self.count = self.open = self.commits = 0.0
        self.widest = 0

    def receive(self, timeout_s):
        due_s = self.count / self.hz
        if due_s > self.now + timeout_s or self.open >= self.gives:
            self.now += timeout_s
            return None
        self.now = max(self.now, due_s)
        self.count, self.open = self.count + 1, self.open + 1
        self.widest = max(self.widest, self.open)
        scan = {"t": due_s, "sensor": "evt", "boxes": [[20, 100, 40, 30]], "scores": [0.9]}
        return b"garbage" if self.garbage else json.dumps(scan).encode()

    def commit(self):
        self.commits, self.open = self.commits + 1, 0


def session_of(source, folder, kept=dict, commit=None):
    live = LiveTracker(Tracker(load_config("default", ["smoother.engine=none"])))
    ends = Ends(tracks=lambda *_: None, warn=lambda _: None, kept=kept, commit=commit or source.commit)
    session = Session(live, ends, folder / "state.npz", every_s=1e6)
    session._pace = CommitPace(lambda: source.now)
    return session


def serve(source, folder, seconds):
    """Have a service take what the source gives in so many seconds of its clock; count of checkpoints."""
    path = folder / "service.yaml"
    path.write_text("sources: [{url: 'mqtt://host/t'}]\nsinks: [{url: '-'}]\n")
    service = Service(read_service(path)[0], Log("x", io.StringIO()))
    opened = OpenedSource(source, EndStatus("fake", Notices()))
    saved = []

    def commit():
        source.commit()
        opened.open = 0

    def kept():
        saved.append(source.now)
        return {}

    session = session_of(source, folder, kept, commit)
    running = _Running(session, [opened], None, None, BadLines(lambda _: None), StreamReading(goes_on=True))
    while source.now < seconds:
        service._take_from(opened, running, 0.05)
    return len(saved)


@pytest.mark.parametrize("most_open", [256, 1000])
@pytest.mark.parametrize("hz", [4, 100])
def test_a_checkpoint_a_second_at_most_whatever_the_rate(hz, most_open, tmp_path):
    assert 1 <= serve(Source(hz, most_open), tmp_path, 5.0) <= 6


def test_a_source_that_would_stall_is_told_sooner(tmp_path):
    source = Source(200, 20)
    assert serve(source, tmp_path, 2.0) >= 15
    assert source.count >= 0.95 * 400


def test_a_broker_that_gives_less_than_it_was_asked_for_is_not_waited_for(tmp_path):
    source = Source(100, 1000, gives=32)
    serve(source, tmp_path, 4.0)
    assert source.widest == 32
    assert source.count >= 0.9 * 400


@pytest.mark.parametrize("garbage", [True, False])
def test_stream_keeps_the_pace_and_commits_garbage_too(garbage, tmp_path):
    source, bad = Source(100, 40, garbage=garbage), []
    session = session_of(source, tmp_path)

    class Interrupts:
        @property
        def seen(self):
            return None if source.now < 5.0 else 15

    stream_command._take_from(source, session, Interrupts(), bad.append, StreamReading(goes_on=True))
    assert source.count >= 0.95 * 500
    assert (len(bad) > 400) == garbage
    assert 4 <= source.commits <= 500 / 40 + 6
