"""Cameras that are on: whose clock a picture's time is of, what is dropped, how a connection is mended."""

from __future__ import annotations

import itertools
import threading
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.errors import ConfigError, DataError, LostError
from jeat_graph.io.capture.back_off import BackOff
from jeat_graph.io.capture.event_camera import open_event_camera
from jeat_graph.io.capture.reader import LiveReader
from jeat_graph.io.capture.stream_clock import StreamClock
from jeat_graph.io.capture.wall_clock import WallClock
from jeat_graph.io.event_cameras.record import EventCameraKind
from jeat_graph.io.event_cameras.registry import event_cameras
from jeat_graph.io.events.opening import open_events
from jeat_graph.io.files.addresses import events_address, frames_address, is_live
from jeat_graph.io.media.video import open_frames, peek


def times(stamps, arrivals, clock=None):
    clock = clock or StreamClock()
    return [clock.time_of(float(s), float(a)) for s, a in zip(stamps, arrivals, strict=True)]


class TestStreamClock:
    def test_a_picture_has_its_own_time_however_late_it_comes(self):
        stamps = np.arange(400) / 20
        late = np.random.default_rng(0).uniform(0.02, 0.09, 400)
        late[10] = 0.02
        found = times(stamps, 1000.0 + stamps + late)
        off = np.array(found[50:], dtype=float) - (1000.02 + stamps[50:])
        assert np.abs(off).max() < 0.004  # arrival times would be up to 70 ms off
        assert np.ptp(np.diff(found[50:])) < 0.002

    def test_what_had_waited_in_a_store_has_no_time(self):
        stamps = np.arange(40) / 20
        arrivals = np.where(np.arange(40) < 20, 5.0, 5.0 + (stamps - stamps[19]))
        found = times(stamps, arrivals)
        assert found[:20] == [None] * 20
        assert found[20] == pytest.approx(5.05)
        assert found[-1] == pytest.approx(6.0)

    def test_a_stream_without_stamps_has_times_of_arrival(self):
        arrivals = np.arange(20) / 10
        found = times(np.zeros(20), arrivals)
        assert found[-10:] == pytest.approx(arrivals[-10:])

    def test_stamps_that_somebody_made_up_do_not_count(self):
        # 25 a second by the stamps, 10 a second in truth.
        arrivals = 100.0 + np.arange(400) / 10
        clock = StreamClock()
        found = times(np.arange(400) / 25, arrivals, clock)
        assert not clock.by_stamps
        assert found[-50:] == pytest.approx(arrivals[-50:])

    def test_a_clock_that_drifts_is_followed(self):
        stamps = np.arange(20 * 3600) / 20
        arrivals = 1e9 + stamps * (1 + 5e-5)  # 0.18 s in an hour
        found = times(stamps, arrivals)
        assert found[-1] == pytest.approx(arrivals[-1], abs=0.01)

    @given(st.lists(st.tuples(st.floats(-1.0, 5.0), st.floats(0.0, 5.0)), min_size=2, max_size=60))
    def test_times_ascend_whatever_the_stream_says(self, steps):
        stamps, arrivals = np.cumsum(steps, axis=0).T
        found = [t for t in times(stamps, arrivals) if t is not None]
        assert all(b > a for a, b in itertools.pairwise(found))


class TestWallClock:
    def test_it_goes_along_with_a_clock_that_is_set_ahead_but_never_back(self):
        now, steady = [100.0], [0.0]
        clock = WallClock(lambda: now[0], lambda: steady[0])
        assert clock() == 100.0
        now[0], steady[0] = 101.5, 1.0  # half a second of drift is no setting
        assert clock() == 101.0
        now[0], steady[0] = 1e9, 2.0
        assert clock() == 1e9
        now[0], steady[0] = 50.0, 3.0
        assert clock() == 1e9 + 1.0


class FakeCamera:
    """Gives numbers, and breaks off or fails where it is to."""

    def __init__(self, script):
        self.script, self.closed = iter(script), 0

    def connect(self):
        step = next(self.script)
        if isinstance(step, Exception):
            raise step
        self.items = iter(step)
        return self

    def read(self):
        item = next(self.items, None)
        if item is None:
            raise LostError("broke off")
        if callable(item):
            return item()
        return item

    def close(self):
        self.closed += 1


def forever():
    time.sleep(0.05)


class TestLiveEvents:
    def test_no_event_comes_before_those_of_the_piece_before(self, monkeypatch):
        """The third piece arrives early: what it was taken to be late by falls by a hundredth of its step."""
        rows = [("t", "i8"), ("x", "u2"), ("y", "u2"), ("p", "u1")]
        pieces = [[0, 10_000], [10_010, 20_000], [20_010, 30_000]]
        items = [np.array([(t, 1, 2, 1) for t in piece], dtype=rows) for piece in pieces]
        camera = FakeCamera([[*items, *[forever] * 999]])
        camera.size_px = (4, 3)
        kind = EventCameraKind("fake", ("fake:",), "", "t", "p", 0, lambda _: camera.connect())
        monkeypatch.setitem(event_cameras(), "fake", kind)
        arrivals = iter([100.0, 100.02, 100.0225])
        with open_event_camera(events_address("fake:"), lambda _: None, now=lambda: next(arrivals)) as reader:
            # The first piece may have waited in a store: nothing says when it was taken.
            second, third = reader.take(5.0), reader.take(5.0)
        assert second.events.t_us.tolist() == [100_010_010, 100_020_000]
        assert third.events.t_us.tolist() == [100_020_000, 100_029_900]  # and not from 100_019_910 on


class TestLiveReader:
    def test_the_oldest_is_dropped_when_nobody_takes_it_and_counted(self):
        camera = FakeCamera([[*range(10), *[forever] * 1000]])
        with LiveReader("camera", camera.connect, lambda _: None) as reader:
            while reader.status.taken < 10:
                time.sleep(0.01)
            assert [reader.take(0.0), reader.take(0.0), reader.take(0.0)] == [8, 9, None]
            assert reader.status.dropped == 8

    def test_a_connection_is_mended_with_growing_pauses_and_each_is_said(self, monkeypatch):
        monkeypatch.setattr("jeat_graph.io.capture.back_off.FIRST_S", 0.01)
        pauses = BackOff(0.01, 0.04)
        monkeypatch.setattr("jeat_graph.io.capture.reader.BackOff", lambda: pauses)
        said = []
        camera = FakeCamera(
            [[1], LostError("nobody answers"), LostError("nobody answers"), [2, *[forever] * 99]]
        )
        with LiveReader("camera", camera.connect, said.append) as reader:
            assert reader.take(5.0) == 1
            assert reader.take(5.0) == 2
            assert reader.status.connected
            assert reader.status.reconnects == 1
        assert said[:4] == [
            "camera: connected",
            "warning: camera: broke off; trying again in 0.01 s",
            "warning: camera: nobody answers; trying again in 0.02 s",
            "warning: camera: nobody answers; trying again in 0.04 s",
        ]
        assert said[4].startswith("camera: connected again, after ")

    def test_what_no_attempt_would_mend_ends_it(self):
        camera = FakeCamera([ConfigError("needs a package more")])
        with (
            LiveReader("camera", camera.connect, lambda _: None) as reader,
            pytest.raises(ConfigError, match="needs a package more"),
        ):
            reader.take(5.0)

    def test_a_camera_that_says_nothing_is_connected_anew(self):
        nothing = [lambda: time.sleep(0.02)] * 100
        said = []
        camera = FakeCamera([[1, *nothing], [2, *nothing]])
        with LiveReader("camera", camera.connect, said.append, patience_s=0.1) as reader:
            assert [reader.take(5.0), reader.take(5.0)] == [1, 2]
        assert "warning: camera: nothing has come for 0.1 s; trying again in 0.5 s" in said

    def test_closing_ends_the_thread(self):
        camera = FakeCamera([[1, *[forever] * 1000]])
        with LiveReader("camera", camera.connect, lambda _: None) as reader:
            reader.take(5.0)
        assert camera.closed == 1
        assert not [thread for thread in threading.enumerate() if thread.name == "read camera"]


@given(st.integers(0, 40))
def test_pauses_double_up_to_the_longest(number):
    pauses = BackOff()
    found = [pauses.failed() for _ in range(number + 1)]
    assert found[-1] == min(0.5 * 2.0**number, 30.0)
    pauses.succeeded()
    assert pauses.failed() == 0.5


class TestAddresses:
    @pytest.mark.parametrize(
        "text", ["rtsp://cam/x", "http://cam/x", "https://cam/x", "/dev/video0", "0", "12"]
    )
    def test_cameras_are_told_from_files(self, text):
        assert is_live(text)
        frames_address(text)

    @pytest.mark.parametrize(
        "text", ["night.mp4", "frames", "mqtt://host/x", "dv.mp4", "1234", "c:/video.mp4"]
    )
    def test_files_are_no_cameras(self, text):
        assert not is_live(text)

    def test_a_file_with_the_name_of_a_number_is_a_file(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        (tmp_path / "0").mkdir()
        assert not is_live("0")

    def test_no_form_of_an_address_shows_its_login(self, monkeypatch, tmp_path):
        (tmp_path / "secret").write_text("canary-p@ss/word\n")
        monkeypatch.setenv("CANARY", "canary-p@ss/word")
        for text in (
            "rtsp://canary-user:canary-p%40ss%2Fword@10.0.0.7:8554/a?channel=1",
            "rtsp://canary-user:${CANARY}@10.0.0.7:8554/a?channel=1",
            f"rtsp://canary-user@10.0.0.7:8554/a?channel=1&password_file={tmp_path}/secret",
        ):
            address = frames_address(text)
            assert "canary" not in f"{address} {address!r} {address.shown} {address.opened}"
            assert address.opened.reveal() == (
                "rtsp://canary-user:canary-p%40ss%2Fword@10.0.0.7:8554/a?channel=1"
            )

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            ("rtsp:///x", "names no host"),
            ("rtsp://u:canary@host/a@b", "in a path @ is written %40"),
            ("rtsp://u:${NO_SUCH_CANARY}@host/a", "NO_SUCH_CANARY is not set"),
            ("rtsp://host:99999/a", "the port is no number"),
            ("rtsp://u:canary@host/a?password_file=x", "without a password"),
            ("dv://host", "give it as --events"),
        ],
    )
    def test_what_is_wrong_is_said_without_the_password(self, text, words):
        with pytest.raises(ConfigError, match=r"\w") as error:
            frames_address(text)
        assert words in str(error.value)
        assert ":canary" not in str(error.value)

    def test_event_cameras(self):
        assert events_address("dv://10.0.0.7").port == 9090
        assert events_address("dv:").kind == "dv"
        assert events_address("metavision:00050423").opened.reveal() == "00050423"
        with pytest.raises(ConfigError, match="has no network address"):
            events_address("metavision://host")

    def test_who_reads_files_says_that_a_camera_is_none(self):
        for read in (open_frames, peek):
            with pytest.raises(
                DataError, match="is a camera that is on: `detect`, `track` and `stream` take"
            ):
                read("rtsp://u:canary@host/x")
        with pytest.raises(DataError, match="is a camera that is on"):
            open_events("dv:")
