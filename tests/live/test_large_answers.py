"""An answer that is larger than a broker takes: reported, counted and not sent, and the next ones arrive."""

from __future__ import annotations

import ctypes
import json
import re
import signal
import time
import uuid

import pytest
from live_tests import brokers
from live_tests.fake_mqtt import FakeBroker

from jeat_graph.data.errors import JeatGraphError
from jeat_graph.live.transport.ends import open_sink, open_source
from jeat_graph.live.transport.patience import UnconfirmedError

PATIENCE_S = 60.0
#: What the brokers here take (bytes), and how much more they count than the message.
MOST, HEAD = 20_000, 200


def warnings_to(told):
    """Take lines for the user, but for those that say that there is a connection."""
    return lambda line: told.append(line) if line.startswith("warning: ") else None


def limited_mosquitto(folder):
    pytest.importorskip("paho.mqtt", reason="the client is not installed")
    return brokers.mosquitto(folder, f"max_packet_size {MOST}")


def limited_nats(folder):
    pytest.importorskip("nats", reason="the client is not installed")
    (folder / "nats.conf").write_text(f"max_payload: {MOST}\n")
    return brokers.nats_server(folder, "-c", str(folder / "nats.conf"))


BROKERS = {"mqtt": limited_mosquitto, "nats": limited_nats}


@pytest.fixture(scope="module", params=BROKERS)
def begin(request, tmp_path_factory):
    """Scheme, host and port of a broker that takes no large messages."""
    server = BROKERS[request.param](tmp_path_factory.mktemp("broker"))
    if server is None:
        pytest.skip(f"this machine has no server for {request.param}")
    yield f"{request.param}://127.0.0.1:{server.port}"
    server.stop()


def receive(source, count: int) -> list[bytes]:
    found: list[bytes] = []
    end = time.monotonic() + PATIENCE_S
    while len(found) < count and time.monotonic() < end:
        message = source.receive(0.2)
        if message is not None:
            found.append(message)
            source.commit()
    return found


@pytest.mark.parametrize("size", [MOST + 1, 2 * MOST, 2_000_000])
def test_it_is_told_of_and_the_others_arrive(size, begin):
    url, told = f"{begin}/t{uuid.uuid4().hex}", []
    source, sink = open_source(url), open_sink(url, tell=warnings_to(told))
    for message in (b"0", b"x" * size, b"1"):
        sink.send(message)
    sink.flush()
    assert receive(source, 2) == [b"0", b"1"]
    assert sink.too_large == 1
    assert len(told) == 1
    assert f"an answer of {size} bytes is larger than the broker takes" in told[0]
    sink.close()
    source.close()


def test_at_the_bound_every_message_arrives_or_is_told_of(begin):
    """Of messages of any size about the bound the small ones arrive, and as many are too large as do not."""
    url = f"{begin}/t{uuid.uuid4().hex}"
    source, sink = open_source(url), open_sink(url)
    for below in range(HEAD + 1):
        sink.send(b"x" * (MOST - below))
    sink.flush()
    arrived = [len(message) for message in receive(source, HEAD + 1 - sink.too_large)]
    assert arrived == list(range(MOST - sink.too_large, MOST - HEAD - 1, -1))
    assert sink.too_large < HEAD
    assert source.receive(0.2) is None
    sink.close()
    source.close()


def test_the_first_are_told_one_by_one_and_the_rest_is_counted(begin):
    told: list[str] = []
    sink = open_sink(f"{begin}/t{uuid.uuid4().hex}", tell=warnings_to(told))
    for _ in range(20):
        sink.send(b"x" * 2 * MOST)
    sink.close()
    assert len(told) == 5
    assert told[-1].endswith("further ones are only counted")
    assert sink.too_large == 20


def scan(seq: int, boxes: int) -> bytes:
    """A message of vehicles that stand in rows, so that each is a track of its own."""
    rows = [[60 * (k % 30), 60 * (k // 30), 40, 30] for k in range(boxes)]
    one = {"t": 0.05 * seq, "sensor": "rgb", "boxes": rows, "scores": [0.95] * boxes}
    return json.dumps({"v": 1, "source": "cam", "seq": seq, "scans": [one]}).encode()


def test_a_stream_goes_on_and_sums_up(begin, start, tmp_path):
    """Scans of 200 vehicles, whose tracks are larger than the broker takes, between scans of one."""
    topic = f"{begin}/t{uuid.uuid4().hex}"
    answers, scans = open_source(f"{topic}out"), open_sink(f"{topic}in")
    record = tmp_path / "record.json"
    options = ["--image", "1920x1080", "--record", record]
    process = start("stream", "--source", f"{topic}in", "--sink", f"{topic}out", *options)
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end and answers.receive(0.5) is None:
        scans.send(scan(0, 1))
    answers.commit()
    seqs = range(1, 61)
    for k in seqs:
        scans.send(scan(k, 200 if 10 <= k < 40 else 1))
    found: list[int] = []
    while time.monotonic() < end and (not found or found[-1] != 60):
        message = answers.receive(0.5)
        if message is not None:
            answer = json.loads(message)
            found += [answer["of"]] if "of" in answer else []  # a change of a sensor's health answers nothing
            answers.commit()
    process.send_signal(signal.SIGTERM)
    assert process.wait(PATIENCE_S) == 128 + signal.SIGTERM
    said = process.stderr.read().decode()
    lost = json.loads(record.read_text())["answers_too_large"]
    assert lost > 5
    assert len(re.findall("larger than the broker takes", said)) == 5 + 1
    assert f"{lost} answer(s) were larger than the broker takes and were not sent" in said
    assert len(set(found) - {0}) == 60 - lost  # and nothing else is missing
    scans.close()
    answers.close()


class TestMosquittoThatDoesNotSay:
    """`message_size_limit`: the broker takes no larger message, and does not say so when it greets."""

    @pytest.fixture
    def url(self, tmp_path):
        pytest.importorskip("paho.mqtt", reason="the client is not installed")
        server = brokers.mosquitto(tmp_path, f"message_size_limit {MOST}")
        if server is None:
            pytest.skip("this machine has no mosquitto")
        yield f"mqtt://127.0.0.1:{server.port}/t"
        server.stop()

    def test_the_sink_ends_and_names_the_size_and_a_way_on(self, url):
        sink = open_sink(url)
        sink.send(b"0")
        sink.send(b"x" * 2 * MOST)
        with pytest.raises(
            JeatGraphError, match=rf"takes no answer of {2 * MOST} bytes.* \(\?largest=BYTES\)"
        ):
            sink.flush()
        with pytest.raises(JeatGraphError):
            sink.close()

    def test_that_way_on_is_one(self, url):
        told: list[str] = []
        source, sink = open_source(url), open_sink(f"{url}?largest={MOST}", tell=warnings_to(told))
        for message in (b"0", b"x" * (MOST + 1), b"1"):
            sink.send(message)
        sink.flush()
        assert receive(source, 2) == [b"0", b"1"]
        assert f"an answer of {MOST + 1} bytes is larger than the broker takes ({MOST})" in told[0]
        sink.close()
        source.close()


def test_a_broker_that_ends_the_connection_without_a_word_is_not_asked_for_ever(monkeypatch):
    monkeypatch.setattr("jeat_graph.live.transport.mqtt_link._AGAIN_S", (0, 0))
    with FakeBroker(ends_above=MOST) as broker:
        sink = open_sink(f"mqtt://127.0.0.1:{broker.port}/t")
        sink.send(b"0")
        sink.flush()
        sink.send(b"x" * 2 * MOST)
        with pytest.raises(JeatGraphError, match=f"5 times.* takes no answer of {2 * MOST} bytes"):
            sink.flush()
        count = broker.connections
        time.sleep(0.5)
        assert broker.connections == count == 5
        with pytest.raises(JeatGraphError):
            sink.close()


class TestNatsStreams:
    @pytest.fixture
    def server(self, tmp_path):
        pytest.importorskip("nats", reason="the client is not installed")
        server = brokers.nats_server(tmp_path)
        if server is None:
            pytest.skip("this machine has no nats-server")
        yield server
        server.stop()

    def made(self, server, **settings) -> str:
        """A sink's address, whose stream is made with these settings."""
        import asyncio

        import nats

        name = f"s{uuid.uuid4().hex}"

        async def make() -> None:
            client = await nats.connect(f"nats://127.0.0.1:{server.port}")
            await client.jetstream().add_stream(name=name, subjects=[name], **settings)
            await client.close()

        asyncio.run(make())
        return f"nats://127.0.0.1:{server.port}/{name}"

    def test_what_a_stream_does_not_take_is_told_of_and_the_others_arrive(self, server):
        told: list[str] = []
        url = self.made(server, max_msg_size=100)
        sink, source = open_sink(url, tell=warnings_to(told)), open_source(url)
        for message in (b"0", b"x" * 1000, b"1"):
            sink.send(message)
        sink.flush()
        assert receive(source, 2) == [b"0", b"1"]
        assert "an answer of 1000 bytes is larger than the broker takes" in told[0]
        sink.close()
        source.close()

    def test_a_full_stream_is_told_of_once_and_tried_again_at_long_intervals(self, server):
        """Sent again without a pause it took a whole processor."""
        told: list[str] = []
        begin = time.monotonic()
        url = self.made(server, max_msgs=1, discard="new")
        sink = open_sink(url, lambda: time.monotonic() - begin > 3.0, warnings_to(told))
        sink.send(b"0")
        sink.send(b"1")
        tries = counting(sink)
        with pytest.raises(UnconfirmedError):
            sink.flush()
        assert len(told) == 1
        assert "maximum messages exceeded" in told[0]
        assert 1 <= tries() <= 10
        sink.close()

    def test_a_stream_that_does_not_hold_the_subject_ends_it(self, server):
        url = self.made(server)
        other = self.made(server).rpartition("/")[2]
        sink = open_sink(f"{url}?stream={other}")
        sink.send(b"0")
        with pytest.raises(JeatGraphError, match="the server refuses tracks: expected stream does not match"):
            sink.flush()


def counting(sink):
    """How often a sink has published since now."""
    count = [0]
    publish = sink._publish

    def once_more(message: bytes, number: int):
        count[0] += 1
        return publish(message, number)

    sink._publish = once_more
    return lambda: count[0]


class TestKafka:
    _PRODUCE, _TOO_LARGE = 0, 10

    def test_what_the_broker_refuses_for_its_size_is_told_of_and_the_others_arrive(self):
        pytest.importorskip("confluent_kafka", reason="the client is not installed")
        server = brokers.MockKafka()
        told: list[str] = []
        sink = open_sink(f"kafka://127.0.0.1:{server.port}/t", tell=warnings_to(told))
        sink.send(b"0")
        sink.flush()
        push = server._library.rd_kafka_mock_push_request_errors
        push(
            server._cluster, ctypes.c_int16(self._PRODUCE), ctypes.c_size_t(1), ctypes.c_int(self._TOO_LARGE)
        )
        sink.send(b"x" * 1_500_000)  # more than the client by itself would try
        sink.flush()
        sink.send(b"1")
        sink.flush()
        assert sink.too_large == 1
        assert "an answer of 1500000 bytes is larger than the broker takes" in told[0]
        sink.close()
        server.stop()

    def test_what_the_client_itself_does_not_take_is_told_of(self, monkeypatch):
        pytest.importorskip("confluent_kafka", reason="the client is not installed")
        monkeypatch.setattr("jeat_graph.live.transport.kafka._MESSAGE_MOST", MOST)
        server = brokers.MockKafka()
        told: list[str] = []
        sink = open_sink(f"kafka://127.0.0.1:{server.port}/t", tell=warnings_to(told))
        sink.send(b"x" * 2 * MOST)
        sink.send(b"1")
        sink.close()
        assert f"an answer of {2 * MOST} bytes is larger than the broker takes" in told[0]
        server.stop()
