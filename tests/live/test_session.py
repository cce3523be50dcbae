"""A live session: detectors that are started again, what is reported of it, and what a checkpoint knows."""

from __future__ import annotations

import contextlib
import io
import json

import pytest

from jeat_graph.cli.main import main
from jeat_graph.config.reading import load_config
from jeat_graph.data.errors import DataError
from jeat_graph.live.late import LiveTracker
from jeat_graph.live.messages import decode_scans
from jeat_graph.live.session import Ends, Session
from jeat_graph.live.session_warnings import MOST_WARNED
from jeat_graph.live.transport.patience import UnconfirmedError
from jeat_graph.tracking.tracker import Tracker

CONFIG = load_config("default", ["smoother.engine=none", "sensors.rgb={}", "sensors.evt={}"])


def message(seq, t, source="g7", sensor="rgb"):
    scan = {"t": t, "sensor": sensor, "boxes": [[100 + 5 * t, 100, 40, 30]], "scores": [0.9]}
    return decode_scans(json.dumps({"v": 1, "source": source, "seq": seq, "scans": [scan]}).encode(), "x", 1)


def clipped(seq, t):
    """A message of a scan whose only box has no area."""
    scan = {"t": t, "sensor": "rgb", "boxes": [[100, 100, 0, 30]], "scores": [0.9]}
    return decode_scans(json.dumps({"v": 1, "seq": seq, "scans": [scan]}).encode(), "x", 1)


def session_of(live=None, checkpoint=None, more=None):
    """A session with lists of the times it answered and of what it said."""
    answered, said = [], []
    ends = Ends(tracks=lambda t, *_: answered.append(t), warn=said.append)
    live = LiveTracker(Tracker(CONFIG)) if live is None else live
    return Session(live, ends, checkpoint, more=more), answered, said


def test_a_detector_that_is_started_again_goes_on_and_is_told_of_once():
    session, answered, said = session_of()
    for start in (0.0, 5.0):
        for k in range(40):
            session.accept(message(k, start + 0.05 * k), f"broker:{k}: ")
    assert len(answered) == 80
    (warning,) = said
    assert warning.startswith("warning: broker:0: source 'g7' restarts its count at seq 0")
    assert session.duplicates == 0
    assert session.summary()["restarts"] == {"g7": 1}
    session.finish()
    assert said[1:] == ["source 'g7' restarted its count of messages once"]


def test_one_that_is_started_again_and_again_is_told_of_some_times():
    session, answered, said = session_of()
    for k in range(20):
        session.accept(message(0, 0.5 * k))
    assert len(answered) == 20
    assert len(said) == MOST_WARNED
    assert said[-1].endswith("further ones are only counted")
    assert session.summary_lines() == ["source 'g7' restarted its count of messages 19 times"]


def test_messages_that_had_been_taken_are_in_the_summary():
    session, answered, said = session_of()
    for k in (0, 1, 1, 2, 0, 3):
        session.accept(message(k, 0.05 * k))
    assert len(answered) == 4
    assert session.summary_lines() == ["2 messages had been taken before and were passed over"]
    assert said == []


def test_boxes_without_area_are_left_out_and_counted_across_a_checkpoint(tmp_path):
    path = tmp_path / "state.npz"
    session, answered, said = session_of(checkpoint=path)
    for k in range(3):
        session.accept(clipped(k, 0.05 * k))
    session.save()
    live, more = LiveTracker.load(path, CONFIG)
    again, answered_again, _ = session_of(live, more=more)
    again.accept(clipped(3, 0.15))
    assert len(answered + answered_again) == 4
    assert said == []
    assert again.summary()["boxes_without_area"] == 4
    assert again.summary_lines() == ["4 box(es) without area left out"]


@pytest.mark.parametrize("taken", [50, 70])
def test_after_a_restart_of_both_what_a_broker_brings_again_is_recognised(taken, tmp_path):
    """The detector was started again after its 40th message, the tracker somewhat later."""
    messages = [message(k, 0.05 * k) for k in range(40)] + [message(k, 5.0 + 0.05 * k) for k in range(40)]
    session, answered, _ = session_of(checkpoint=tmp_path / "state.npz")
    for one in messages[:taken]:
        session.accept(one)
    session.save()
    live, more = LiveTracker.load(tmp_path / "state.npz", CONFIG)
    again, answered_again, said = session_of(live, more=more)
    for one in messages:
        again.accept(one)
    assert answered + answered_again == [one.batch.t for one in messages]
    assert again.duplicates == taken
    assert said == []
    assert again.summary()["restarts"] == {"g7": 1}


class Broker:
    """Takes answers until it is gone, and says whether they have arrived; what was committed is in `at`."""

    def __init__(self) -> None:
        self.gone_at, self.at, self.answered = ("", 10**9), 0, []

    def tracks(self, t, *_) -> None:
        self._look("send")
        self.answered.append(t)

    def flush(self) -> None:
        self._look("flush")

    def commit(self) -> None:
        self.at = len(self.answered)

    def _look(self, what) -> None:
        if what == self.gone_at[0] and len(self.answered) >= self.gone_at[1]:
            raise UnconfirmedError("broker: the broker has not confirmed all tracks")


@pytest.mark.parametrize("where", ["send", "flush"])
def test_what_a_broker_has_not_confirmed_is_neither_saved_nor_acknowledged(where, tmp_path):
    path, broker, said = tmp_path / "state.npz", Broker(), []
    ends = Ends(tracks=broker.tracks, warn=said.append, flush=broker.flush, commit=broker.commit)
    session = Session(LiveTracker(Tracker(CONFIG)), ends, path)
    messages = [message(k, 0.05 * k) for k in range(40)]
    for one in messages[:20]:
        session.accept(one)
    session.save()
    broker.gone_at = (where, 25)
    with contextlib.suppress(UnconfirmedError):
        for one in messages[20:30]:
            session.accept(one)
    broker.gone_at = (where, 25) if where == "flush" else ("", 0)  # those before may arrive after all
    session.save()
    session.finish()
    assert broker.at == 20
    (warning,) = said
    assert "has not confirmed all tracks; their scans are not acknowledged or saved" in warning
    live, more = LiveTracker.load(path, CONFIG)
    again, answered, _ = session_of(live, path, more)
    for one in messages:
        again.accept(one)
    assert answered == [one.batch.t for one in messages[20:]]


def test_an_answer_that_a_reader_who_has_gone_did_not_take_is_in_no_checkpoint(tmp_path):
    path = tmp_path / "state.npz"
    answered = []

    def tracks(t, *_) -> None:
        if len(answered) == 7:
            raise BrokenPipeError
        answered.append(t)

    session = Session(LiveTracker(Tracker(CONFIG)), Ends(tracks=tracks, warn=print), path)
    messages = [message(k, 0.05 * k) for k in range(8)]
    for one in messages[:7]:
        session.accept(one)
    with pytest.raises(BrokenPipeError):
        session.accept(messages[7])
    session.save()
    assert not path.exists()


@pytest.mark.parametrize("kept", [{"seen": {}}, {"seen": None}, {"seen": {"seen": {"a": [[1]]}}}])
def test_what_a_damaged_checkpoint_keeps_is_refused_in_one_line(kept, tmp_path):
    path = tmp_path / "state.npz"
    with pytest.raises(DataError, match=r"state\.npz: is damaged"):
        Session(LiveTracker(Tracker(CONFIG)), Ends(lambda *_: None), path, more=kept)


class Sink:
    """Takes messages to a broker."""

    too_large = 0

    def __init__(self) -> None:
        self.told = []

    def send(self, message) -> None:
        self.told.append(json.loads(message))

    def flush(self) -> None: ...

    def close(self) -> None: ...


def test_after_a_restart_messages_are_numbered_on_from_the_last_events_too(tmp_path, monkeypatch):
    """A sensor that falls silent and comes back makes two messages that answer none."""
    times = [(0.05 * k, "rgb") for k in range(20)] + [(1.0 + 0.05 * k, "evt") for k in range(80)]
    times += [(5.0, "rgb"), *((5.0 + 0.05 * k, "evt") for k in range(1, 15))]
    boxes = {"boxes": [[100, 100, 40, 30]], "scores": [0.9]}
    lines = [json.dumps({"t": t, "sensor": sensor, **boxes}).encode() + b"\n" for t, sensor in times]
    sink = Sink()
    monkeypatch.setattr("jeat_graph.live.transport.ends.open_sink", lambda *_: sink)
    command = ["stream", "--sink", "mqtt://nowhere/tracks", "--checkpoint", str(tmp_path / "state.npz")]
    for part in (lines[:60], lines[60:90], lines[90:]):
        monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"".join(part))))
        assert main(command) == 0
    assert [one["event"] for one in sink.told if "event" in one] == ["sensor-silent", "sensor-back"]
    assert [one["seq"] for one in sink.told] == list(range(len(lines) + 2))
