"""`serve --check` finds what would end a start; labels are unique; a broker that is away blames no camera."""

from __future__ import annotations

import re
import socket
import threading
import time

import numpy as np
import pytest
from live_tests import certificates, video

from jeat_graph.cli.main import main
from jeat_graph.config.reading import load_config
from jeat_graph.data.scan import Scan
from jeat_graph.live.service.status import Status

GOOD = """\
name: gantry7
tracker: {config: default, image: [1280, 720]}
sources:
  - frames: rtsp://127.0.0.1:1/road?channel=1
    detector: motion
    sensor: left
sinks:
  - url: '-'
state: {checkpoint: state/a.npz, smoothed: state/rows.csv}
web: {port: 0}
"""


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    return certificates.make(tmp_path_factory.mktemp("keys"))


def written(folder, text):
    path = folder / "service.yaml"
    path.write_text(text)
    path.chmod(0o600)
    return path


def test_a_good_file_is_valid_and_nothing_is_made(tmp_path, capsys):
    path = written(tmp_path, GOOD)
    assert main(["serve", "--check", str(path)]) == 0
    assert capsys.readouterr().out == f"{path}: valid: 1 sources, 1 sinks\n"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("config: default", "config: defautl", "defautl"),
        (
            "config: default",
            "config: default, set: [smoother.engine=none]",
            "state.smoothed needs a smoother",
        ),
        ("config: default", "config: default, set: [smother.lag_s=1]", "smother"),
        ("config: default", "config: paper", "state.checkpoint does not go with tracker.engine=paper"),
        ("detector: motion", "detector: yolo-nano-typo", "sources[0].detector: "),
        ("detector: motion", "detector: service.yaml", "sources[0].detector: "),
        ("detector: motion", "set: [frames.nothing=1]", "frames.nothing"),
        ("detector: motion", "embedder: reid.pt", "sources[0].embedder: "),
        ("smoothed: state/rows.csv", "smoothed: service.yaml/rows.csv", "state.smoothed: "),
        ("checkpoint: state/a.npz", "checkpoint: .", "state.checkpoint: "),
        ("web: {port: 0}", "web: {host: 192.0.2.7}", "web.host: 192.0.2.7: is no address of this machine"),
    ],
)
def test_what_would_end_a_start_is_said_before(old, new, words, tmp_path, capsys):
    path = written(tmp_path, GOOD.replace(old, new, 1))
    assert main(["serve", "--check", str(path)]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("options", [["--check"], []])
def test_a_key_that_is_no_certificate_is_refused(options, keys, tmp_path, capsys):
    pytest.importorskip("paho.mqtt", reason="the client is not installed")
    broker = f"sinks:\n  - url: mqtts://127.0.0.1:1/tracks\n    tls: {{ca: {keys}/server.key}}\n"
    path = written(tmp_path, re.sub(r"sinks:\n.*\n", broker, GOOD))
    assert main(["serve", *options, str(path)]) == 2
    assert "sinks[0]: " in (said := capsys.readouterr().err)
    assert "server.key: no certificate" in said


def test_connect_says_who_does_not_answer(tmp_path, capsys):
    pytest.importorskip("nats", reason="the client is not installed")
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    broker = f"sinks:\n  - url: nats://127.0.0.1:{port}/tracks\n"
    path = written(tmp_path, re.sub(r"sinks:\n.*\n", broker, GOOD))
    assert main(["serve", "--check", str(path)]) == 0
    assert main(["serve", "--check", "--connect", str(path)]) == 2
    assert f"sinks[0]: nats://127.0.0.1:{port}/tracks: does not answer" in capsys.readouterr().err


def test_connect_looks_at_cameras_until_they_give_a_picture(tmp_path, capsys):
    camera = video.MjpegCamera()
    address = f"http://127.0.0.1:{camera.port}/video"
    path = written(tmp_path, GOOD.replace("rtsp://127.0.0.1:1/road?channel=1", address))
    try:
        assert main(["serve", "--check", "--connect", str(path)]) == 0
    finally:
        camera.stop()
    assert "left (http" in capsys.readouterr().err


def test_connect_alone_means_nothing(tmp_path, capsys):
    assert main(["serve", "--connect", str(written(tmp_path, GOOD))]) == 2
    assert "--connect goes with --check" in capsys.readouterr().err


def test_two_channels_of_one_recorder_have_labels_of_their_own(tmp_path):
    pytest.importorskip("prometheus_client", reason="the extra `serve` is not installed")
    from contextlib import ExitStack

    from prometheus_client.parser import text_string_to_metric_families

    from jeat_graph.live.service.cameras import Cameras
    from jeat_graph.live.service.config import read_service
    from jeat_graph.live.service.log import Log
    from jeat_graph.live.service.metrics import Metrics

    two = "  - {frames: 'rtsp://127.0.0.1:1/road?channel=2', detector: motion, sensor: right}\nsinks:"
    config, _ = read_service(written(tmp_path, GOOD.replace("sinks:", two)))
    status = Status("gantry7", 10.0)
    with ExitStack() as stack:
        Cameras(config, status, Log("gantry7"), stack)
        text = Metrics(status).text().decode()
    for family in text_string_to_metric_families(text):
        labels = [(*sorted(one.labels.items()), one.name) for one in family.samples]
        assert len(set(labels)) == len(labels)
    assert 'sensor="left"' in text
    assert 'sensor="right"' in text
    assert [one["sensor"] for one in status.health()["cameras"]] == ["left", "right"]
    problems = status.problems()
    assert any(one.startswith("left (rtsp://127.0.0.1:1/road): not connected") for one in problems)


def test_what_is_known_of_a_network_is_told_of_its_camera_by_the_name_that_it_has(tmp_path):
    from contextlib import ExitStack

    from jeat_graph.live.service.cameras import Cameras
    from jeat_graph.live.service.config import read_service
    from jeat_graph.live.service.log import Log

    config, _ = read_service(written(tmp_path, GOOD.replace("detector: motion", "detector: sehn")))
    with ExitStack() as stack:
        cameras = Cameras(config, Status("gantry7", 10.0), Log("gantry7"), stack)
        sensors = load_config("default", cameras.settings(Log("gantry7"))).sensors
    assert sensors.keys() == {"left"}
    assert sensors["left"].kind == "camera"
    assert sensors["left"].even_score is not None


def a_scan(t, sensor="rgb"):
    return Scan(t, sensor, np.zeros((0, 4)), np.zeros(0))


def test_while_a_broker_takes_nothing_no_camera_is_called_silent():
    status = Status("gantry7", silent_s=0.2)
    status.came([a_scan(1.0)], ["rgb"])
    ended = threading.Event()

    def send():
        with status.blocked():
            ended.wait(5.0)

    thread = threading.Thread(target=send)
    thread.start()
    time.sleep(0.5)
    assert status.changes_of_silence() == []
    assert not any("rgb" in problem for problem in status.problems())
    ended.set()
    thread.join()
    assert status.changes_of_silence() == []
    time.sleep(0.4)
    assert [name for name, _ in status.changes_of_silence()] == ["rgb"]


@pytest.mark.parametrize("origin", [0.0, time.time])
def test_health_says_how_far_behind_a_stream_is(origin):
    begun, origin = time.time(), origin if isinstance(origin, float) else origin()
    status = Status("gantry7", silent_s=10.0)
    status.came([a_scan(origin)], ["rgb"])
    time.sleep(0.3)
    assert status.health()["sensors"]["rgb"]["behind_s"] == pytest.approx(time.time() - begun, abs=0.1)
    status.came([a_scan(origin + 0.1)], ["rgb"])  # of a queue: 0.2 s behind
    assert status.health()["sensors"]["rgb"]["behind_s"] == pytest.approx(time.time() - begun - 0.1, abs=0.1)
