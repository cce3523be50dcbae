"""Sources and sinks against real brokers: in order, at least once, through restarts, never flooded."""

from __future__ import annotations

import threading
import time
import uuid

import pytest
from live_tests import brokers

from jeat_graph.data.errors import JeatGraphError
from jeat_graph.live.transport.ends import open_sink, open_source

SCHEMES = {"mqtt": "paho.mqtt", "nats": "nats", "kafka": "confluent_kafka"}
PATIENCE_S = 120.0
#: Groups of Kafka take seconds to come together: that they do is tried by the messages in their order.
PATIENT = pytest.mark.parametrize(
    "broker", ["mqtt", "nats", pytest.param("kafka", marks=pytest.mark.slow)], indirect=True, scope="module"
)


@pytest.fixture(scope="module", params=SCHEMES)
def broker(request, tmp_path_factory):
    """(scheme, server) of each broker that this machine has."""
    scheme = request.param
    pytest.importorskip(SCHEMES[scheme], reason=f"the client for {scheme} is not installed")
    folder = tmp_path_factory.mktemp(scheme)
    make = {"mqtt": brokers.mosquitto, "nats": brokers.nats_server, "kafka": lambda _: brokers.MockKafka()}
    server = make[scheme](folder)
    if server is None:
        pytest.skip(f"this machine has no server for {scheme}")
    yield scheme, server
    server.stop()


@pytest.fixture
def url(broker):
    """The address of a topic that nobody has used."""
    scheme, server = broker
    return f"{scheme}://127.0.0.1:{server.port}/t{uuid.uuid4().hex}"


def receive(source, count: int, commit_every: int = 1) -> list[bytes]:
    """The next `count` messages, or as many as come."""
    found: list[bytes] = []
    end = time.monotonic() + PATIENCE_S
    while len(found) < count and time.monotonic() < end:
        message = source.receive(0.2)
        if message is not None:
            found.append(message)
            if len(found) % commit_every == 0:
                source.commit()
    return found


def numbered(count: int, start: int = 0) -> list[bytes]:
    return [b"%d" % k for k in range(start, start + count)]


def send(url: str, messages: list[bytes]) -> None:
    sink = open_sink(url)
    for message in messages:
        sink.send(message)
    sink.close()


def test_messages_come_in_order_each_once(url):
    source = open_source(url)
    send(url, numbered(300))
    assert receive(source, 300) == numbered(300)
    assert source.receive(0.2) is None
    source.close()


@PATIENT
def test_what_was_not_committed_comes_again_in_order_and_what_was_does_not(url):
    source = open_source(url)
    send(url, numbered(30))
    assert receive(source, 10, commit_every=4) == numbered(10)  # 8 and 9 are open
    source.close()
    again = open_source(url)
    assert receive(again, 22) == numbered(22, start=8)
    again.close()


def test_a_sender_waits_for_a_slow_receiver_or_the_broker_holds_the_rest(url):
    if url.startswith("kafka"):
        pytest.skip("the broker's log is the buffer: nothing is pushed")
    most = 50  # more than the 20 of Mosquitto's max_inflight_messages
    source = open_source(f"{url}?most={most}")
    send(url, numbered(3 * most))
    assert receive(source, most, commit_every=10**9) == numbered(most)
    assert source.receive(0.5) is None  # no more until they are committed
    source.commit()
    assert receive(source, 2 * most) == numbered(2 * most, start=most)
    source.close()


def test_what_is_sent_once_a_source_is_open_is_never_lost(url):
    """The broker has heard of an open source: nothing is left to the race of two connections."""
    if not url.startswith("mqtt"):
        pytest.skip("the broker keeps a log for whoever comes")
    for k in range(20):
        source, sink = open_source(f"{url}{k}"), open_sink(f"{url}{k}")
        sink.send(b"%d" % k)
        assert receive(source, 1) == [b"%d" % k]
        sink.close()
        source.close()


@PATIENT
def test_a_first_message_is_not_kept_waiting_for_more(url):
    source = open_source(url)
    send(url, [b"warm"])
    receive(source, 1)
    sink = open_sink(url)
    start = time.monotonic()
    sink.send(b"now")
    assert source.receive(PATIENCE_S) == b"now"
    # The wait offered is sixty times as long: whoever waits for a full packet or the end of the time fails.
    assert time.monotonic() - start < PATIENCE_S / 6
    sink.close()
    source.close()


def test_both_ends_survive_a_restart_of_the_broker(broker, url):
    scheme, server = broker
    if scheme == "kafka":
        pytest.skip("the mock cluster lives in a client and cannot be restarted")
    source, sink = open_source(url), open_sink(url)
    for message in numbered(20):
        sink.send(message)
    assert receive(source, 15) == numbered(15)
    sink.flush()
    server.stop()

    def publish() -> None:
        for message in numbered(20, start=20):
            sink.send(message)
        sink.flush()

    sender = threading.Thread(target=publish, daemon=True)
    sender.start()
    time.sleep(0.3)
    server.start()
    found: list[bytes] = []
    end = time.monotonic() + PATIENCE_S
    expected = set(numbered(25, start=15))
    while not expected <= set(found) and time.monotonic() < end:
        message = source.receive(0.2)
        if message is not None:
            found.append(message)
            source.commit()
    # At least once; a broker that ends may forget the last acknowledgements, and then sends those again.
    assert expected <= set(found)
    first = list(dict.fromkeys(found))
    assert first == sorted(first, key=int)
    sender.join(PATIENCE_S)
    sink.close()
    source.close()


@pytest.mark.parametrize("scheme", SCHEMES)
def test_nobody_at_the_address_is_one_sentence(scheme, monkeypatch):
    pytest.importorskip(SCHEMES[scheme], reason=f"the client for {scheme} is not installed")
    module = pytest.importorskip(f"jeat_graph.live.transport.{scheme}")
    monkeypatch.setattr(module, "_CONNECT_S", 1)
    with pytest.raises(JeatGraphError, match=f"{scheme}://127.0.0.1:"):
        open_source(f"{scheme}://127.0.0.1:{brokers.free_port()}/t")
