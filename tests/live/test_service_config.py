"""The file of a service: what is wrong is said with its line, and no password leaves it."""

from __future__ import annotations

import io
import json
import logging
import os
import socket
import sys
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.cli.main import main
from jeat_graph.data.errors import ConfigError, InputWarning
from jeat_graph.data.notes import note
from jeat_graph.data.scan import Scan
from jeat_graph.live.service.config import read_service
from jeat_graph.live.service.log import Log
from jeat_graph.live.service.status import Status
from jeat_graph.live.service.systemd import Watchdog, notify, watchdog_s

GOOD = """\
name: gantry7
tracker: {config: default, image: [1280, 720]}
sources:
  - url: nats://host/scans
  - frames: rtsp://cam/road
    detector: motion
sinks:
  - url: mqtts://host/tracks
"""


def written(folder, text):
    path = folder / "service.yaml"
    path.write_text(text)
    path.chmod(0o600)
    return path


def test_a_good_file_is_read(tmp_path):
    config, warnings = read_service(written(tmp_path, GOOD))
    assert config.name == "gantry7"
    assert [source.given for source in config.sources] == [
        ("url", "nats://host/scans"),
        ("frames", "rtsp://cam/road"),
    ]
    assert config.tracker.image == (1280, 720)
    assert warnings == []


def test_paths_are_seen_from_the_folder_of_the_file(tmp_path, monkeypatch):
    (tmp_path / "mine.yaml").write_text("base: default\n")
    text = GOOD.replace("config: default", "config: mine.yaml") + "state: {checkpoint: state/a.npz}\n"
    config, _ = read_service(written(tmp_path, text))
    assert config.tracker.config == str(tmp_path / "mine.yaml")
    assert config.state.checkpoint == str(tmp_path / "state" / "a.npz")


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("name:", "nam:", 1, "unknown key nam; did you mean name?"),
        ("image: [1280, 720]", "image: [1280]", 2, "tracker.image: must have 2 entries"),
        ("image:", "imag:", 2, "unknown key tracker.imag"),
        ("nats://host/scans", "nats://host", 4, "sources[0].url: 'nats://host': names no topic"),
        ("  - url: nats://host/scans", "  - ulr: nats://host/scans", 4, "did you mean sources[0].url?"),
        ("rtsp://cam/road", "road.mp4", 5, "sources[1].frames: is no camera that is on"),
        ("    detector: motion", "    tls: {ca: x}", 6, "sources[1].tls: says nothing of a camera"),
        (
            "nats://host/scans",
            "nats://host/scans\n    embedder: colour",
            5,
            "sources[0].embedder: says nothing",
        ),
        ("frames: rtsp://cam/road", "events: /dev/x\n    embedder: colour", 6, "describes boxes in pictures"),
        ("    detector: motion", "    url: nats://h/t", 5, "sources[1]: names url and frames"),
        ("mqtts://host/tracks", "mqtts://host/a/#", 8, "tracks go to one topic, without wild cards"),
        ("mqtts://host/tracks", "nats://host/scans", 4, "would come back as scans"),
        ("sinks:", "silent_s: 0\nsinks:", 7, "silent_s: 0.0 is not in (0.0"),
        ("sources:", "sources: [", 4, "not valid YAML"),
        ("name: gantry7", "name: gantry7\nname: b", 2, "name comes twice"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(old, new, line, words, tmp_path, capsys):
    path = written(tmp_path, GOOD.replace(old, new, 1))
    assert main(["serve", str(path)]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"jeat-graph serve: {path}:{line}: ")
    assert words in said
    assert said.count("\n") == 1


@pytest.mark.parametrize("gone", ["sources", "sinks"])
def test_one_that_does_nothing_is_refused(gone, tmp_path):
    text = GOOD.partition("sinks:")[0] if gone == "sinks" else "sinks: [{}]\n"
    with pytest.raises(ConfigError, match=f"{gone}: names none"):
        read_service(written(tmp_path, text))


def test_no_such_file(tmp_path, capsys):
    assert main(["serve", str(tmp_path / "none.yaml")]) == 2
    assert capsys.readouterr().err == f"jeat-graph serve: {tmp_path}/none.yaml: No such file or directory\n"


@pytest.mark.parametrize("options", [["--check"], []])
@pytest.mark.parametrize(
    ("text", "package", "named"),
    [
        ("sources: [{url: nats://127.0.0.1:1/t}]\nsinks: [{url: '-'}]", "nats", "'nats-py>=2.9,<3'"),
        ("sources: [{url: mqtt://127.0.0.1:1/t}]\nsinks: [{url: '-'}]", "paho", "'paho-mqtt>=2.1,<3'"),
        ("sources: [{frames: rtsp://cam/t}]\nsinks: [{url: kafka+tls://h/t}]", "confluent_kafka", "kafka>="),
        (
            "sources: [{frames: rtsp://cam/t}]\nsinks: [{url: mqtt://127.0.0.1:1/t, encoding: msgpack}]",
            "msgpack",
            "'msgpack>=1.1,<2'",
        ),
    ],
)
def test_a_missing_client_ends_it_and_is_named(options, text, package, named, tmp_path, monkeypatch, capsys):
    if package == "msgpack":
        pytest.importorskip("paho.mqtt", reason="the client is not installed")
    for name in [name for name in sys.modules if name.startswith("jeat_graph.live.transport.")]:
        if name.rpartition(".")[2].startswith(("mqtt", "nats", "kafka")):
            monkeypatch.delitem(sys.modules, name)
    for name in [package, *(name for name in sys.modules if name.startswith(package + "."))]:
        monkeypatch.setitem(sys.modules, name, None)
    path = written(tmp_path, text + "\nweb: {port: 0}\n")
    assert main(["serve", *options, str(path)]) == 2
    said = capsys.readouterr().err
    assert "needs a package more: pip install" in said
    assert named in said
    assert said.count("\n") == 1


def test_a_password_that_others_may_read_is_warned_of_and_not_shown(tmp_path, capsys):
    pytest.importorskip("paho.mqtt", reason="the client is not installed")
    pytest.importorskip("nats", reason="the client is not installed")
    path = written(tmp_path, GOOD.replace("rtsp://cam/road", "rtsp://u:canary@cam/road"))
    path.chmod(0o644)
    assert main(["serve", "--check", str(path)]) == 0
    said = capsys.readouterr()
    assert "chmod o-r" in said.err
    assert "canary" not in said.err + said.out
    path.chmod(0o600)
    assert read_service(path)[1] == []


def test_a_password_comes_from_a_file_beside_it(tmp_path):
    (tmp_path / "secret").write_text("canary\n")
    text = GOOD.replace("rtsp://cam/road", "rtsp://u@cam/road\n    password_file: secret")
    config, _ = read_service(written(tmp_path, text))
    assert "canary" not in repr(config)
    with pytest.raises(ConfigError, match="No such file"):
        read_service(written(tmp_path, text.replace("secret", "none")))


@given(st.text(max_size=60))
def test_no_text_is_a_traceback(text):
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "service.yaml"
        path.write_text(text, encoding="utf-8", errors="replace")
        with pytest.raises(ConfigError):
            read_service(path)


def test_the_log_is_json_a_line_and_strikes_logins_out():
    stream = io.StringIO()
    log = Log("gantry7", stream)
    log.say("warning: rtsp://u:canary@cam/x: gone\nfor long")
    log.write("info", "running", messages=3)
    first, second = [json.loads(line) for line in stream.getvalue().splitlines()]
    assert (first["level"], first["service"]) == ("warning", "gantry7")
    assert first["text"] == "rtsp://***@cam/x: gone\nfor long"
    assert second["messages"] == 3
    assert second["time"].endswith("Z")


def test_warnings_and_notes_are_lines_of_the_log(capsys):
    stream = io.StringIO()
    with Log("gantry7", stream).of_libraries():
        warnings.warn("boxes lie outside", InputWarning, stacklevel=1)
        note("the first frame is 1")
    logging.getLogger("broker").error("is gone")
    lines = [json.loads(line) for line in stream.getvalue().splitlines()]
    assert [(line["level"], line["text"]) for line in lines] == [
        ("warning", "boxes lie outside"),
        ("info", "the first frame is 1"),
    ]
    assert "boxes" not in capsys.readouterr().err


class TestSystemd:
    @pytest.fixture
    def manager(self, tmp_path, monkeypatch):
        receiver = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        receiver.bind(str(tmp_path / "notify"))
        receiver.settimeout(5.0)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        yield receiver
        receiver.close()

    def test_it_is_told_what_happens(self, manager):
        notify("READY=1")
        assert manager.recv(99) == b"READY=1"

    def test_the_dead_give_no_sign_of_life(self, manager, monkeypatch):
        monkeypatch.setenv("WATCHDOG_USEC", "150000")
        monkeypatch.setenv("WATCHDOG_PID", str(os.getpid()))
        quiet = [0.0]
        with Watchdog(lambda: quiet[0]):
            assert manager.recv(99) == b"WATCHDOG=1"
            quiet[0] = 1.0
            manager.settimeout(0.3)
            signs = iter(lambda: manager.recv(99), b"")
            with pytest.raises(TimeoutError):
                list(signs)

    def test_without_systemd_nothing_is_said(self, monkeypatch):
        monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
        monkeypatch.setenv("WATCHDOG_USEC", "100")
        monkeypatch.setenv("WATCHDOG_PID", "1")
        notify("READY=1")
        assert watchdog_s() is None


def test_all_sensors_may_fall_silent_and_each_is_named_once(monkeypatch):
    now = [100.0]
    monkeypatch.setattr("jeat_graph.live.service.status.time.monotonic", lambda: now[0])
    status = Status("gate", silent_s=10.0)
    scan = {name: Scan(1.0, name, np.zeros((0, 4)), np.zeros(0)) for name in ("rgb", "evt")}
    status.came(scan.values(), scan)
    now[0] = 109.0
    assert status.changes_of_silence() == []
    now[0] = 112.0
    assert status.changes_of_silence() == [("rgb", 12.0), ("evt", 12.0)]
    assert status.changes_of_silence() == []
    status.came([scan["evt"]], ["evt"])
    assert status.changes_of_silence() == [("evt", None)]
