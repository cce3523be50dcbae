"""Brokers over TLS: the authority is believed that is named and no other, and names itself who must."""

from __future__ import annotations

import socket
import ssl
import threading
import uuid

import pytest
from live_tests import brokers, certificates

from jeat_graph.data.errors import ConfigError, JeatGraphError
from jeat_graph.live.transport.ends import open_sink, open_source, sink_address, source_address

CLIENTS = {"mqtt": "paho.mqtt", "nats": "nats"}


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    return certificates.make(tmp_path_factory.mktemp("keys"))


@pytest.fixture(scope="module", params=CLIENTS)
def broker(request, keys, tmp_path_factory):
    """(scheme, server) of a broker that asks its clients for a certificate."""
    folder = tmp_path_factory.mktemp("broker")
    pytest.importorskip(CLIENTS[request.param], reason="the client is not installed")
    if request.param == "mqtt":
        files = [f"cafile {keys}/ca.pem", f"certfile {keys}/server.pem", f"keyfile {keys}/server.key"]
        server = brokers.mosquitto(folder, *files, "require_certificate true")
    else:
        files = ["--tlscacert", f"{keys}/ca.pem", "--tlscert", f"{keys}/server.pem"]
        server = brokers.nats_server(folder, "--tlsverify", *files, "--tlskey", f"{keys}/server.key")
    if server is None:
        pytest.skip("this machine has no server")
    yield request.param, server
    server.stop()


def url_of(broker, options):
    scheme, server = broker
    return f"{scheme}+tls://127.0.0.1:{server.port}/t{uuid.uuid4().hex}?{options}"


def test_messages_go_and_come_encrypted(broker, keys):
    mine = f"ca={keys}/ca.pem&cert={keys}/client.pem&key={keys}/client.key"
    url, told = url_of(broker, mine), []
    source, sink = open_source(url, tell=told.append), open_sink(url)
    try:
        sink.send(b"tracks")
        sink.flush()
        found = [source.receive(1.0) for _ in range(10)]
        assert [message for message in found if message is not None] == [b"tracks"]
        assert told == [f"{source_address(url)}: connected"]
    finally:
        source.close()
        sink.close()


@pytest.mark.parametrize("ca", ["other.pem", None])
def test_a_broker_that_a_stranger_vouches_for_is_refused(broker, keys, ca):
    mine = f"cert={keys}/client.pem&key={keys}/client.key"
    url = url_of(broker, mine if ca is None else f"ca={keys}/{ca}&{mine}")
    with pytest.raises(JeatGraphError, match=r"certificate|unknown ca"):
        open_sink(url)


def test_one_without_a_certificate_is_not_let_in(broker, keys):
    with pytest.raises(JeatGraphError):
        open_sink(url_of(broker, f"ca={keys}/ca.pem"))


def test_to_believe_anybody_is_said_loudly(broker, keys):
    url, told = url_of(broker, f"insecure=yes&cert={keys}/client.pem&key={keys}/client.key"), []
    sink = open_sink(url, tell=told.append)
    sink.flush()
    sink.close()
    assert any("INSECURE: the broker's certificate is not looked at" in line for line in told)


def test_kafka_shows_its_certificate_and_looks_at_the_other(keys):
    """There is no Kafka with TLS here: a server that ends the handshake and then says nothing more."""
    kafka = pytest.importorskip("confluent_kafka")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(keys / "server.pem", keys / "server.key")
    context.load_verify_locations(keys / "ca.pem")
    context.verify_mode = ssl.CERT_REQUIRED
    shown, refused = [], []
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(20.0)

        def serve() -> None:
            try:
                while not shown:
                    connection, _ = listener.accept()
                    connection.settimeout(5.0)
                    try:
                        with context.wrap_socket(connection, server_side=True) as encrypted:
                            shown.append(encrypted.getpeercert())
                            shown.append(encrypted.recv(4) != b"")  # the client's first request
                    except OSError as error:
                        refused.append(error)
            except OSError:
                pass

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        from jeat_graph.live.transport.kafka import _settings
        from jeat_graph.live.transport.notices import Notices

        where = f"kafka+tls://127.0.0.1:{listener.getsockname()[1]}/t"
        mine = f"cert={keys}/client.pem&key={keys}/client.key"
        for ca, good in (("other.pem", False), ("ca.pem", True)):
            address = sink_address(f"{where}?ca={keys}/{ca}&{mine}")
            producer = kafka.Producer(_settings(address, Notices()))
            with pytest.raises(kafka.KafkaException):
                producer.list_topics(timeout=2.0)
            assert bool(shown) == good
        thread.join(20.0)
    assert refused
    assert shown == [shown[0], True]
    assert (("commonName", "client"),) in shown[0]["subject"]


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("mqtt://h/t?ca=x", "ca is of an encrypted connection: write mqtt+tls://"),
        ("nats+tls://h/t?ca=/no/such", "ca: /no/such: no such file"),
        ("mqtts://h/t?insecure=maybe", "insecure is yes or no"),
        ("mqtt+tls://u:canary@h/t?cert={f}", "cert and key go together"),
        ("kafka+tls://h/t?insecure=yes&ca={f}", "looks at no certificate"),
        ("https://h/t", "is no address of a broker"),
    ],
)
def test_what_is_wrong_is_said(url, words, tmp_path):
    (tmp_path / "f").touch()
    with pytest.raises(ConfigError) as error:
        sink_address(url.format(f=tmp_path / "f"))
    assert words in str(error.value)
    assert "canary" not in str(error.value)


def test_a_file_that_is_no_certificate_is_named(tmp_path):
    pytest.importorskip("paho.mqtt")
    (tmp_path / "ca").write_text("none")
    with pytest.raises(ConfigError, match="no certificate"):
        open_sink(f"mqtt+tls://127.0.0.1:1/t?ca={tmp_path}/ca")


def test_ports_and_names_of_encrypted_brokers():
    assert source_address("mqtts://h/t").port == 8883
    assert source_address("kafka+tls://h/t").port == 9093
    assert str(source_address("mqtts://h/t")) == "mqtt+tls://h:8883/t"


def test_a_password_that_goes_unencrypted_over_a_network_is_warned_of():
    from jeat_graph.live.transport.ends import _warn_of
    from jeat_graph.live.transport.notices import Notices

    told = []
    notices = Notices(told.append)
    for url in ("mqtt://u:canary@h/t", "mqtt://u:canary@127.0.0.1/t", "mqtts://u:canary@h/t", "mqtt://h/t"):
        _warn_of(source_address(url), notices)
    notices.tell()
    assert told == [
        "warning: mqtt://h:1883/t: the password goes over the network unencrypted; mqtt+tls:// encrypts"
    ]
