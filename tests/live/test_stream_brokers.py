"""`stream` between brokers: every scan answered, nothing twice, nothing lost when it is killed."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
import uuid

import pytest
from live_tests import brokers

from jeat_graph.io.tables.detections_io import read_detections
from jeat_graph.live.transport.ends import open_sink, open_source

COMMAND = [sys.executable, "-m", "jeat_graph.cli.main", "stream"]
PATIENCE_S = 120.0


@pytest.fixture(scope="module")
def messages(simulated):
    """A recording as numbered messages, some of them sent twice."""
    detections = read_detections(simulated(1) / "detections.csv")
    scans = [detections.scan(k) for k in range(detections.num_scans)]
    out = []
    for k, scan in enumerate(scans):
        content = {
            "t": scan.t,
            "sensor": scan.sensor,
            "boxes": scan.boxes.tolist(),
            "scores": scan.scores.tolist(),
        }
        message = json.dumps({"v": 1, "source": "cam", "seq": k, "scans": [content]}).encode()
        out += [message, message] if k % 10 == 3 else [message]
    return out


def answers_from(source, last: int, process) -> list[dict]:
    """The answers up to that of message `last`."""
    found: list[dict] = []
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end and (not found or found[-1].get("of") != last):
        message = source.receive(0.2)
        if message is not None:
            found.append(json.loads(message))
            source.commit()
        elif process.poll() is not None:
            raise AssertionError(process.stderr.read())
    return found


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["mqtt", "nats"])
def test_killed_in_between_it_answers_every_message_and_each_alike(scheme, messages, tmp_path):
    pytest.importorskip({"mqtt": "paho.mqtt", "nats": "nats"}[scheme], reason="the client is not installed")
    server = {"mqtt": brokers.mosquitto, "nats": brokers.nats_server}[scheme](tmp_path)
    if server is None:
        pytest.skip(f"this machine has no server for {scheme}")
    topic = f"{scheme}://127.0.0.1:{server.port}/t{uuid.uuid4().hex}"
    command = [*COMMAND, "--source", topic + "in", "--sink", topic + "out"]
    command += ["--checkpoint", str(tmp_path / "state.npz"), "--every", "0.3"]
    answers = open_source(topic + "out")
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    try:
        sink = open_sink(topic + "in")
        half = len(messages) // 2
        middle = json.loads(messages[half - 1])["seq"]
        if scheme == "mqtt":
            wait_for_subscriber(topic + "in", process, answers, sink, messages[0])
        for message in messages[:half]:
            sink.send(message)
        said = answers_from(answers, middle, process)
        process.kill()
        process.wait()
        process.stderr.close()
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        for message in messages[half:]:
            sink.send(message)
        said += answers_from(answers, json.loads(messages[-1])["seq"], process)
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE_S) == 128 + signal.SIGTERM
        sink.close()
    finally:
        process.kill()
        process.wait()
        process.stderr.close()
        answers.close()
        server.stop()
    by_number: dict[int, dict] = {}
    for one in said:
        if "of" in one:
            same = by_number.setdefault(one["of"], one)
            assert (same["t"], same["tracks"]) == (one["t"], one["tracks"])
    # The first answer has told that the stream is there.
    numbers = {json.loads(message)["seq"] for message in messages}
    assert set(by_number) | {0} == numbers


def wait_for_subscriber(url, process, answers, sink, message) -> None:
    """An MQTT broker keeps nothing for a session that has never been: send the first until it is answered."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        sink.send(message)
        if answers.receive(1.0) is not None:
            return
        assert process.poll() is None, process.stderr.read()
    raise AssertionError(f"nobody answers at {url}")
