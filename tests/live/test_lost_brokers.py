"""A broker that is gone while a signal comes: the end is near all the same, and nothing is lost by it."""

from __future__ import annotations

import json
import signal
import time
import uuid

import pytest
from live_tests import brokers

from jeat_graph.live.transport.ends import open_sink, open_source
from jeat_graph.live.transport.patience import UnconfirmedError

CLIENTS = {"mqtt": "paho.mqtt", "nats": "nats", "kafka": "confluent_kafka"}
SERVERS = {"mqtt": brokers.mosquitto, "nats": brokers.nats_server, "kafka": lambda _: brokers.MockKafka()}
PATIENCE_S = 120.0
#: An end within about a second of the signal; a machine with other work gets some more.
SOON_S = 4.0


def server_of(scheme, folder):
    pytest.importorskip(CLIENTS[scheme], reason=f"the client for {scheme} is not installed")
    server = SERVERS[scheme](folder)
    if server is None:
        pytest.skip(f"this machine has no server for {scheme}")
    return server


class Deadline:
    """Says that the program is to end when so many seconds have passed since it was set."""

    def __init__(self) -> None:
        self.at = float("inf")

    def set(self, seconds: float) -> None:
        self.at = time.monotonic() + seconds

    def __call__(self) -> bool:
        return time.monotonic() > self.at


def took(do) -> float:
    begin = time.monotonic()
    do()
    return time.monotonic() - begin


@pytest.mark.parametrize("gone", ["stopped", "frozen"])
@pytest.mark.parametrize("scheme", CLIENTS)
def test_no_wait_for_a_broker_that_is_gone_outlasts_the_program(scheme, gone, tmp_path):
    if (scheme, gone) == ("kafka", "frozen"):
        pytest.skip("the mock cluster lives in this process")
    server = server_of(scheme, tmp_path)
    url = f"{scheme}://127.0.0.1:{server.port}/t{uuid.uuid4().hex}"
    over = Deadline()
    source, sink = open_source(url, over), open_sink(f"{url}?most=3", over)
    try:
        sink.send(b"0")
        sink.flush()
        server.stop() if gone == "stopped" else server.freeze()

        def send_all() -> None:
            for k in range(1, 10):
                sink.send(b"%d" % k)

        over.set(0.5)
        with pytest.raises(UnconfirmedError, match=r"has not confirmed all tracks"):
            assert took(send_all) < SOON_S
        with pytest.raises(UnconfirmedError):
            assert took(sink.flush) < SOON_S
        assert took(sink.close) < SOON_S
        assert took(lambda: source.receive(0.2)) < SOON_S
        assert took(source.close) < SOON_S
    finally:
        if gone == "frozen":
            server.thaw()
            server.stop()


def message(seq):
    scan = {"t": 0.05 * seq, "sensor": "rgb", "boxes": [[100 + seq, 100, 40, 30]], "scores": [0.9]}
    return json.dumps({"v": 1, "source": "cam", "seq": seq, "scans": [scan]}).encode()


def next_answers(source, last, process) -> list[int]:
    """The numbers of the messages that are answered, up to this one."""
    found: list[int] = []
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end and (not found or found[-1] != last):
        payload = source.receive(0.2)
        if payload is not None:
            found.append(json.loads(payload)["of"])
            source.commit()
        else:
            assert process.poll() is None, process.stderr.read()
    return found


@pytest.mark.parametrize("gone", ["stopped", "frozen"])
@pytest.mark.parametrize("scheme", ["mqtt", "nats"])
def test_a_signal_ends_the_stream_while_the_brokers_of_the_tracks_are_gone(scheme, gone, start, tmp_path):
    """And what the broker has not confirmed is answered after a restart."""
    (tmp_path / "in").mkdir()
    (tmp_path / "out").mkdir()
    scans, tracks = server_of(scheme, tmp_path / "in"), server_of(scheme, tmp_path / "out")
    topic = f"t{uuid.uuid4().hex}"
    given, answered = (f"{scheme}://127.0.0.1:{one.port}/{topic}" for one in (scans, tracks))
    options = ["--source", given, "--sink", f"{answered}?most=4", "--checkpoint", tmp_path / "state.npz"]
    options += ["--every", "0.5"]
    answers, sender = open_source(answered), open_sink(given)
    process = start("stream", *options)
    try:
        # A session of MQTT that has never been is kept nothing for: the first message until it is answered.
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end and answers.receive(0.5) is None:
            sender.send(message(0))
        answers.commit()
        for k in range(1, 20):
            sender.send(message(k))
        said = next_answers(answers, 19, process)
        tracks.stop() if gone == "stopped" else tracks.freeze()
        for k in range(20, 40):
            sender.send(message(k))
        sender.flush()
        time.sleep(1.0)
        assert process.poll() is None
        begin = time.monotonic()
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE_S) == 128 + signal.SIGTERM
        assert time.monotonic() - begin < SOON_S
        complaints = process.stderr.read().decode()
        assert "has not confirmed all tracks" in complaints
        assert complaints.splitlines()[-1] == "jeat-graph stream: interrupted"
        tracks.start() if gone == "stopped" else tracks.thaw()
        process = start("stream", *options)
        said += next_answers(answers, 39, process)
    finally:
        process.kill()
        process.wait()
        sender.close()
        answers.close()
        scans.stop()
        tracks.stop()
    assert set(range(1, 40)) <= set(said)
