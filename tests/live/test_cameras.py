"""Commands that look at cameras which are on: real network video, Motion JPEG and RTSP, and real events."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from live_tests import brokers, video

from jeat_graph.cli.main import main
from jeat_graph.io.capture.camera import open_camera
from jeat_graph.io.capture.event_camera import open_event_camera
from jeat_graph.io.files.addresses import events_address, frames_address

PATIENCE_S = 60.0
QUICK = ["--detector-frames", "motion", "--mask", "none", "--detection-set", "frames.warm_up_s=0.5"]
RTSP = pytest.mark.skipif(not video.has_rtsp(), reason="GStreamer's RTSP server is not installed")


def wait_for(true, patience_s=PATIENCE_S):
    end = time.monotonic() + patience_s
    while not true():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.02)


def answers(capsys):
    """The answers on stdout, without what is said of sensors that fall silent."""
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    return [line for line in lines if "tracks" in line]


@pytest.fixture
def camera():
    made = video.MjpegCamera()
    yield made
    made.stop()


@pytest.fixture
def rtsp():
    made = video.rtsp_camera()
    yield made
    made.stop()


def taken(url, count, every_s=0.0, said=None):
    """Take pictures of a camera; the last of the reader's status, too."""
    found = []
    with open_camera(frames_address(url), (said if said is not None else []).append) as reader:
        while len(found) < count:
            picture = reader.take(PATIENCE_S)
            assert picture is not None
            found.append(picture)
            time.sleep(every_s)
        return found, reader.status


def test_pictures_come_with_their_times(camera):
    found, _ = taken(camera.url, 40)
    steps = np.diff([picture.t for picture in found])
    assert found[0].frame.shape == (video.SIZE_PX[1], video.SIZE_PX[0], 3)
    assert abs(found[-1].t - time.time()) < 2.0
    assert np.mean(steps) == pytest.approx(0.05, abs=0.01)  # and not the 1/25 s that FFmpeg makes up


def test_a_slow_taker_gets_the_newest_pictures_and_the_rest_is_counted(camera):
    found, status = taken(camera.url, 8, every_s=0.25)
    assert status.dropped >= 20
    assert status.dropped + len(found) <= status.taken
    assert found[-1].t > time.time() - 1.0


def test_a_camera_that_was_off_is_connected_again(camera):
    said = []
    with open_camera(frames_address(camera.url), said.append) as reader:
        assert reader.take(PATIENCE_S) is not None
        camera.stop()
        wait_for(lambda: not reader.status.connected)
        time.sleep(1.0)
        before = time.time()
        camera.start()
        wait_for(lambda: reader.status.connected)
        while reader.take(PATIENCE_S).t < before:
            pass
        assert reader.status.reconnects == 1
    assert any("no picture comes any more; trying again in 0.5 s" in line for line in said)
    assert any(line.startswith(f"{camera.url}: connected again, after ") for line in said)


def test_a_wrong_password_is_said_and_no_password_ever(tmp_path, capfd):
    camera = video.MjpegCamera(login="canary-user:canary-right")
    try:
        said = []
        url = f"http://canary-user:canary-wrong@127.0.0.1:{camera.port}/video"
        with open_camera(frames_address(url), said.append):
            wait_for(lambda: bool(said))
        assert "wrong path, user or password" in said[0]
        secret = tmp_path / "secret"
        secret.write_text("canary-right\n")
        good = f"http://canary-user@127.0.0.1:{camera.port}/video?password_file={secret}"
        out = tmp_path / "found.csv"
        assert main(["detect", "--frames", good, *QUICK, "--duration", "3", "--out", str(out)]) == 0
        words = capfd.readouterr()
        assert "canary" not in "".join(said) + words.out + words.err + out.read_text()
    finally:
        camera.stop()


def test_detect_and_track_end_by_themselves(camera, tmp_path, capsys):
    run = tmp_path / "run"
    given = ["track", "--frames", camera.url, *QUICK, "--duration", "4", "--out", str(run)]
    assert main(given) == 0
    words = capsys.readouterr()
    assert "taken, 0 dropped because the detector was slower" in words.err
    rows = np.genfromtxt(run / "causal.csv", delimiter=",", names=True)
    assert 0.0 < rows["t"].min() < rows["t"].max() < 8.0
    assert len(rows) > 30
    assert json.loads((run / "run.json").read_text())["config"]["image"] == {"width": 320, "height": 240}


def test_stream_answers_live_and_goes_on_from_a_checkpoint(camera, tmp_path, capsys):
    state, record = tmp_path / "state.npz", tmp_path / "record.json"
    given = ["stream", "--frames", camera.url, *QUICK, "--duration", "4", "--checkpoint", str(state)]
    last, newest = -1, 0.0
    for _ in range(2):
        assert main([*given, "--record", str(record)]) == 0
        lines = answers(capsys)
        assert len(lines) > 20
        assert all(abs(line["t"] - time.time()) < 60.0 for line in lines)
        assert lines[0]["t"] > newest
        newest = lines[-1]["t"]
        messages = json.loads(record.read_text())
        assert messages["messages"] == len(lines) + max(last, 0)
        assert messages["cameras"][0]["name"] == camera.url
        last = messages["messages"]


def test_ctrl_c_is_the_ordinary_end_of_detect(camera, tmp_path):
    out = tmp_path / "found.csv"
    command = [
        sys.executable,
        "-m",
        "jeat_graph",
        "detect",
        "--frames",
        camera.url,
        *QUICK,
        "--out",
        str(out),
    ]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    wait_for(lambda: camera.given > 60)
    process.send_signal(signal.SIGINT)
    words, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, errors
    assert words.startswith("rgb: ")
    assert len(out.read_text().splitlines()) > 10


class TestRtsp:
    @RTSP
    def test_pictures_have_the_times_of_the_stream(self, rtsp):
        found, _ = taken(f"rtsp://127.0.0.1:{rtsp.port}/road", 40)
        steps = np.diff([picture.t for picture in found])
        assert np.ptp(steps) < 0.005  # RTP's clock: exact, whatever the machine does meanwhile
        assert np.mean(steps) == pytest.approx(0.05, abs=0.001)
        assert abs(found[-1].t - time.time()) < 2.0

    @RTSP
    def test_a_server_that_is_killed_is_connected_again(self, rtsp):
        said = []
        with open_camera(frames_address(f"rtsp://127.0.0.1:{rtsp.port}/road"), said.append) as reader:
            assert reader.take(PATIENCE_S) is not None
            rtsp.stop()
            wait_for(lambda: not reader.status.connected)
            wait_for(lambda: any("nobody answers at port" in line for line in said))
            rtsp.start()
            wait_for(lambda: reader.status.connected)
        assert any("connected again, after" in line for line in said)

    @RTSP
    def test_a_password_opens_it_and_is_nowhere(self, capfd, tmp_path):
        server = video.rtsp_camera(20, "canary-user", "canary-p")
        try:
            url = f"rtsp://canary-user:canary-p@127.0.0.1:{server.port}/road"
            out = tmp_path / "found.csv"
            assert main(["detect", "--frames", url, *QUICK, "--duration", "3", "--out", str(out)]) == 0
            words = capfd.readouterr()
            assert "canary" not in words.out + words.err
            assert len(out.read_text().splitlines()) > 10
        finally:
            server.stop()


_DV_CAMERA = """
import os, sys, time
import dv_processing as dv
stream = dv.io.Stream.EventStream(0, "events", "camera", (320, 240))
writer = dv.io.NetworkWriter("127.0.0.1", int(sys.argv[1]), stream)
begin = time.time()
while True:
    store, now = dv.EventStore(), time.time()
    x0 = 40 + int(60 * (now - begin)) % 200
    for k in range(200):
        store.push_back(int(now * 1e6) - 10_000 + 50 * k, x0 + k % 20, 100 + k % 17, k % 2 == 0)
    writer.writeEvents(store)
    time.sleep(max(now + 0.01 - time.time(), 0.0))
"""


class TestEventCamera:
    @pytest.fixture
    def server(self):
        pytest.importorskip("dv_processing", reason="dv-processing is not installed")
        port = brokers.free_port()
        made = brokers.Server([sys.executable, "-c", _DV_CAMERA, str(port)], port)
        yield made
        made.kill()

    def test_events_come_on_the_clock_of_this_machine_and_a_server_that_was_gone_is_found_again(self, server):
        said = []
        with open_event_camera(events_address(f"dv://127.0.0.1:{server.port}"), said.append) as reader:
            last_us = 0
            for _ in range(50):
                piece = reader.take(PATIENCE_S)
                assert piece.size_px == (320, 240)
                assert piece.events.t_us[0] >= last_us
                assert (np.diff(piece.events.t_us) >= 0).all()
                last_us = int(piece.events.t_us[-1])
            assert abs(last_us / 1e6 - time.time()) < 1.0
            server.kill()
            wait_for(lambda: not reader.status.connected)
            server.start()
            wait_for(lambda: reader.status.connected)
        assert any("no events come any more" in line for line in said)

    def test_events_and_frames_of_one_rig_are_tracked_together(self, server, camera, capsys):
        given = ["stream", "--frames", camera.url, *QUICK, "--events", f"dv://127.0.0.1:{server.port}"]
        assert main([*given, "--duration", "4"]) == 0
        lines = answers(capsys)
        used = {name for line in lines for track in line["tracks"] for name in track["sensors"]}
        assert used == {"rgb", "evt"}
