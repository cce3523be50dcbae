"""A service from end to end: a real broker with TLS that dies and a camera that goes, each answered once."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request

import numpy as np
import pytest
from live_tests import brokers, certificates, video

from jeat_graph.io.streams.track_lines import csv_header
from jeat_graph.live.transport.ends import open_sink, open_source

PATIENCE_S = 60.0
SCANS_HZ = 20.0


def wait_for(true, what, service=None, patience_s=PATIENCE_S):
    end = time.monotonic() + patience_s
    while not (found := true()):
        said = getattr(service, "lines", [])[-5:]
        assert time.monotonic() < end, f"{what}; last of what it said: {said}"
        time.sleep(0.05)
    return found


class Running:
    """A service in a process of its own."""

    def __init__(self, path, port, *options):
        self.port = port
        command = [sys.executable, "-m", "jeat_graph", "serve", *options, str(path)]
        self.process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        self.lines: list[dict] = []
        self._reading = threading.Thread(target=self._read, daemon=True)
        self._reading.start()

    def _read(self):
        for line in self.process.stderr:
            self.lines.append(json.loads(line) if line.startswith("{") else {"text": line})

    def get(self, path):
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{self.port}{path}", timeout=5) as answer:
                return answer.status, answer.read().decode()
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode()
        except OSError:
            return 0, "{}"

    def health(self):
        code, text = self.get("/health")
        health = json.loads(text)
        assert (code == 200) == health.get("ready", False)
        return health

    def answered(self):
        return self.health().get("messages", {}).get("answered", 0)

    def scans(self, sensor):
        return self.health().get("sensors", {}).get(sensor, {}).get("scans", 0)

    def ready(self):
        return self.health().get("ready")

    def problem(self, words):
        return any(words in problem for problem in self.health().get("problems", []))

    def metric(self, name):
        rows = [row.rpartition(" ") for row in self.get("/metrics")[1].splitlines() if row.startswith(name)]
        return {row[0].removeprefix(name): float(row[2]) for row in rows}

    def said(self, words):
        return any(words in line["text"] for line in self.lines)

    def end(self, number=signal.SIGTERM):
        self.process.send_signal(number)
        code = self.process.wait(PATIENCE_S)
        self._reading.join(5.0)
        return code


class Publisher:
    """Sends numbered scans of a vehicle, in a thread, until it is stopped."""

    def __init__(self, url):
        self.sink, self.count, self._stop = open_sink(url), 0, threading.Event()
        self.error: Exception | None = None
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def _run(self):
        while not self._stop.wait(1.0 / SCANS_HZ):
            k = self.count
            scan = {
                "t": time.time(),
                "sensor": "evt",
                "boxes": [[20 + k % 200, 100, 40, 30]],
                "scores": [0.9],
            }
            message = {"v": 1, "source": "gantry7", "seq": k, "scans": [scan]}
            try:
                self.sink.send(json.dumps(message).encode())
            except Exception as error:
                self.error = error
                raise
            self.count += 1

    def stop(self):
        self._stop.set()
        self.thread.join(PATIENCE_S)
        assert self.error is None
        self.sink.flush()
        self.sink.close()


def broker_of(scheme, folder, keys):
    if scheme == "mqtt":
        pytest.importorskip("paho.mqtt", reason="the client is not installed")
        files = [f"cafile {keys}/ca.pem", f"certfile {keys}/server.pem", f"keyfile {keys}/server.key"]
        server = brokers.mosquitto(folder, *files, "require_certificate true")
    else:
        pytest.importorskip("nats", reason="the client is not installed")
        files = ["--tlscacert", f"{keys}/ca.pem", "--tlscert", f"{keys}/server.pem"]
        server = brokers.nats_server(folder, "--tlsverify", *files, "--tlskey", f"{keys}/server.key")
    if server is None:
        pytest.skip("this machine has no such server")
    return server


def answers_until(source, last, found):
    """Read answers until that of a number has come."""
    end = time.monotonic() + PATIENCE_S
    while not any(one.get("of") == last for one in found):
        assert time.monotonic() < end, f"no answer of {last}; the newest is {found[-1:]}"
        payload = source.receive(0.5)
        if payload is not None:
            found.append(json.loads(payload))
            source.commit()


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    return certificates.make(tmp_path_factory.mktemp("keys"))


@pytest.fixture(params=["nats", "mqtt"])
def broker(request, keys, tmp_path):
    """(begin of an address, options of TLS, server): one that asks its clients for certificates."""
    pytest.importorskip("prometheus_client", reason="the extra `serve` is not installed")
    (tmp_path / "broker").mkdir()
    server = broker_of(request.param, tmp_path / "broker", keys)
    yield f"{request.param}+tls://127.0.0.1:{server.port}", server
    server.stop()


def options(keys):
    return f"ca={keys}/ca.pem&cert={keys}/client.pem&key={keys}/client.key"


def tls(keys):
    return f"{{ca: {keys}/ca.pem, cert: {keys}/client.pem, key: {keys}/client.key}}"


def kill(begin, server):
    """NATS has on its disk what it has confirmed; Mosquitto only writes it when it is asked to end."""
    server.kill() if begin.startswith("nats") else server.stop()


def test_each_message_is_answered_once_however_often_broker_and_service_end(broker, keys, tmp_path):
    (begin, server), web = broker, brokers.free_port()
    path = tmp_path / "service.yaml"
    path.write_text(f"""\
name: gantry7
sources: [{{url: "{begin}/scans", tls: {tls(keys)}}}]
sinks: [{{url: "{begin}/tracks", tls: {tls(keys)}}}]
state: {{checkpoint: state.npz, every_s: 1}}
web: {{port: {web}}}
silent_s: 2
""")
    answers = open_source(f"{begin}/tracks?{options(keys)}")
    found: list[dict] = []
    service = Running(path, web)
    try:
        wait_for(lambda: service.said("running"), "the service runs", service)
        publisher = Publisher(f"{begin}/scans?{options(keys)}")
        wait_for(lambda: service.answered() > 10, "it answers", service)
        for _ in range(2):
            kill(begin, server)
            wait_for(lambda: service.problem("/tracks: not connected"), "the dead broker is told of", service)
            assert service.metric("jeat_graph_ready") == {"": 0.0}
            server.start()
            wait_for(service.ready, "it is ready again", service)
            before = service.answered()
            wait_for(lambda: service.answered() > before + SCANS_HZ, "it answers again", service)  # noqa: B023
        assert service.end() == 0
        service = Running(path, web)
        wait_for(lambda: service.said("goes on from"), "it goes on from the checkpoint", service)
        wait_for(lambda: service.answered() > 10, "it answers", service)
        service.process.kill()
        service = Running(path, web)
        wait_for(lambda: service.answered() > 10, "it answers", service)
        publisher.stop()
        answers_until(answers, publisher.count - 1, found)
        assert service.end() == 0
    finally:
        service.process.kill()
        answers.close()
    numbers = [one["of"] for one in found if "of" in one]  # others tell of sensors that fall silent
    assert sorted(set(numbers)) == list(range(publisher.count))
    # After the crash the answers since the checkpoint come again, with the same numbers and bytes.
    contents = {json.dumps(one, sort_keys=True) for one in found}
    assert len({content for content in contents if '"of"' in content}) == publisher.count
    assert {one["seq"] for one in found} == set(range(len(contents)))


def test_health_and_metrics_are_true_at_each_fault(broker, keys, tmp_path):
    (begin, server), web = broker, brokers.free_port()
    camera = video.MjpegCamera(login="canary-user:canary-p")
    (tmp_path / "password").write_text("canary-p\n")
    path = tmp_path / "service.yaml"
    path.write_text(f"""\
name: gantry7
tracker: {{set: [live.late_s=2]}}
sources:
  - {{url: "{begin}/scans", tls: {tls(keys)}}}
  - frames: http://canary-user@127.0.0.1:{camera.port}/video
    password_file: password
    detector: motion
    masks: [none]
    set: [frames.warm_up_s=0.5]
sinks:
  - {{url: "{begin}/tracks", tls: {tls(keys)}}}
state: {{checkpoint: state.npz, every_s: 1}}
web: {{port: {web}}}
silent_s: 2
""")
    answers = open_source(f"{begin}/tracks?{options(keys)}")
    found: list[dict] = []
    service = Running(path, web)
    try:
        wait_for(lambda: service.said("running"), "the service runs", service)
        publisher = Publisher(f"{begin}/scans?{options(keys)}")
        wait_for(
            lambda: {"rgb", "evt"} <= service.health().get("sensors", {}).keys(),
            "both sensors are seen",
            service,
        )
        wait_for(service.ready, "it is ready", service)

        camera.stop()
        wait_for(
            lambda: service.problem("sensor 'rgb': no scan for"), "the silent sensor is told of", service
        )
        assert service.problem(f"127.0.0.1:{camera.port}/video")
        assert service.problem("/video): not connected")
        assert service.metric("jeat_graph_ready") == {"": 0.0}
        wait_for(
            lambda: service.said("sensor 'rgb': no scan for"), "the log names the silent sensor", service
        )
        camera.start()
        wait_for(service.ready, "it is ready again", service)
        wait_for(lambda: service.said("sensor 'rgb' gives scans again"), "and that it speaks", service)

        kill(begin, server)
        wait_for(lambda: service.problem("/tracks: not connected"), "the dead broker is told of", service)
        server.start()
        wait_for(service.ready, "it is ready again", service)
        wait_for(lambda: service.health().get("lag_s", 99.0) < 2.0, "it has caught up", service)
        connected = service.metric("jeat_graph_connected")
        assert set(connected.values()) == {1.0}
        assert len(connected) == 3
        assert min(service.metric("jeat_graph_reconnects_total").values()) == 1.0
        publisher.stop()
        wait_for(lambda: service.scans("evt") == publisher.count, "all have come", service)
        # A service that ends keeps what waits in its checkpoint, unanswered.
        before = service.answered()
        wait_for(lambda: service.answered() > before + 4.0 * SCANS_HZ, "it goes on", service)
        health = service.health()
        assert service.end() == 0
    finally:
        service.process.kill()
        camera.stop()
        while (payload := answers.receive(1.0)) is not None:
            found.append(json.loads(payload))
            answers.commit()
        answers.close()
    answered = {one["of"] for one in found if one.get("source") == "gantry7"}
    # What is late beside the camera, which went on while the broker was gone, is passed over and
    # counted. After a pause scans wait until it is clear that no clock stepped (a second at most);
    # the answer to them names the message that ended that.
    assert publisher.count - len(answered) <= health["messages"]["passed_over"] + SCANS_HZ
    assert not service.said("clock has leapt")
    assert answered
    assert "canary" not in json.dumps(service.lines)


def test_a_broker_that_is_not_there_yet_is_waited_for(tmp_path):
    pytest.importorskip("prometheus_client", reason="the extra `serve` is not installed")
    pytest.importorskip("nats", reason="the client is not installed")
    port, web = brokers.free_port(), brokers.free_port()
    path = tmp_path / "service.yaml"
    path.write_text(
        f"sources: [{{url: 'nats://127.0.0.1:{port}/scans'}}]\nsinks: [{{url: '-'}}]\nweb: {{port: {web}}}\n"
    )
    service = Running(path, web)
    try:
        wait_for(
            lambda: service.problem("Connect call failed"),
            "it says what it waits for",
            service,
        )
        wait_for(lambda: service.said("trying again in 1 s"), "it tries again", service)
        assert service.health()["phase"] == "starting"
        assert service.end() == 0
    finally:
        service.process.kill()


UNREACHED = "sources: [{url: 'nats://127.0.0.1:1/scans'}]\nsinks: [{url: '-'}]\n"


def saved(folder):
    """A checkpoint of a tracker that has taken a scan, in the folder; its path."""
    from jeat_graph import Scan, Tracker, load_config
    from jeat_graph.live.late import LiveTracker

    config = load_config("default", ["smoother.engine=none"])
    live = LiveTracker(Tracker(config))
    live.step(Scan(0.0, "rgb", np.array([[100.0, 100.0, 40.0, 30.0]]), np.array([0.9])))
    live.save(folder / "state.npz")
    return folder / "state.npz"


def damaged(path):
    """The file with one bit of its last array changed; its bytes."""
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    return bytes(content)


def test_a_damaged_checkpoint_is_refused_unless_it_is_to_be_set_aside(tmp_path, capsys):
    from jeat_graph.cli.main import main

    content = damaged(saved(tmp_path))
    path = tmp_path / "service.yaml"
    # What is said of other versions says nothing of damage.
    path.write_text(
        UNREACHED + "web: {port: 0}\nstate: {checkpoint: state.npz, of_another_version: set-aside}\n"
    )
    assert main(["serve", str(path)]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert re.search(r"state\.npz: is .*; or let --set-aside-damaged rename it and start over$", said)
    assert (tmp_path / "state.npz").read_bytes() == content
    assert [file.name for file in tmp_path.glob("state*")] == ["state.npz"]


def test_a_damaged_checkpoint_is_set_aside_and_told_of(tmp_path):
    pytest.importorskip("prometheus_client", reason="the extra `serve` is not installed")
    pytest.importorskip("nats", reason="the client is not installed")
    content, web = damaged(saved(tmp_path)), brokers.free_port()
    (tmp_path / "state.npz.damaged-1").write_text("an earlier one")
    path = tmp_path / "service.yaml"
    path.write_text(f"{UNREACHED}web: {{port: {web}}}\nstate: {{checkpoint: state.npz}}\n")
    service = Running(path, web, "--set-aside-damaged")
    try:
        wait_for(lambda: service.health().get("set_aside"), "/health tells of it", service)
        [why] = service.health()["set_aside"]
        assert service.metric("jeat_graph_checkpoints_set_aside") == {"": 1.0}
        assert service.end() == 0
    finally:
        service.process.kill()
    aside = tmp_path / "state.npz.damaged-2"
    assert why.endswith(f"; it is {aside} now, and the tracker starts over: tracks get new identities")
    [line] = [line for line in service.lines if "damaged-2" in line["text"]]
    assert (line["level"], line["text"]) == ("warning", why)
    assert aside.read_bytes() == content
    assert (tmp_path / "state.npz.damaged-1").read_text() == "an earlier one"
    assert not (tmp_path / "state.npz").exists()


def test_a_checkpoint_of_another_version_is_refused_or_set_aside(tmp_path, monkeypatch, capsys):
    from jeat_graph.cli.main import main
    from jeat_graph.live.service import run
    from jeat_graph.tracking import checkpoint

    with monkeypatch.context() as patch:
        patch.setattr(checkpoint, "FORMAT", 1)
        content = saved(tmp_path).read_bytes()
    path = tmp_path / "service.yaml"
    text = UNREACHED + "web: {port: 0}\nstate: {checkpoint: state.npz, of_another_version: %s}\n"
    path.write_text(text % "refuse")
    assert main(["serve", "--set-aside-damaged", str(path)]) == 2  # it is not damaged
    said = capsys.readouterr().err
    assert "(format 1)" in said
    assert "state.of_another_version: set-aside" in said
    assert (tmp_path / "state.npz").read_bytes() == content

    monkeypatch.setattr(run.Service, "_stopped", lambda self: True)  # it ends before it waits for a broker
    path.write_text(text % "set-aside")
    assert main(["serve", str(path)]) == 0
    assert (tmp_path / "state.npz.other-version-1").read_bytes() == content
    assert not (tmp_path / "state.npz").exists()


def test_smoothed_rows_of_a_run_that_is_not_gone_on_from_are_set_aside(tmp_path, capsys):
    from jeat_graph import Tracker, load_config
    from jeat_graph.live.late import LiveTracker
    from jeat_graph.live.service.config import read_service
    from jeat_graph.live.service.log import Log
    from jeat_graph.live.service.run import Service

    path, rows = tmp_path / "service.yaml", tmp_path / "smoothed.csv"
    path.write_text(UNREACHED)
    service, live = Service(read_service(path)[0], Log("x")), LiveTracker(Tracker(load_config("default")))
    rows.write_text(csv_header(False))
    with service._smoothed_file(str(rows), None, live):
        pass  # without rows it is no loss
    content = csv_header(False) + "0.0,1\n"
    for keep_bytes in (None, 10_000):  # no checkpoint; one of a longer file
        rows.write_text(content)
        with service._smoothed_file(str(rows), keep_bytes, live):
            pass
        assert rows.read_text() == csv_header(False)
    assert [(tmp_path / f"smoothed.csv.earlier-{k}").read_text() for k in (1, 2)] == [content] * 2
    first, second = (json.loads(line)["text"] for line in capsys.readouterr().err.splitlines())
    assert f"{rows}: is of a run that is not continued; it is {rows}.earlier-1 now" in first
    assert f"and had 10000 when the checkpoint was written; it is {rows}.earlier-2 now" in second
    rows.write_text(content)
    with service._smoothed_file(str(rows), 0, live):
        pass  # the checkpoint is from before the first row, and all come again
    assert rows.read_text() == csv_header(False)
    assert not (tmp_path / "smoothed.csv.earlier-3").exists()
