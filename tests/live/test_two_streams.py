"""Two streams at one broker: each message to its own, or one of the two ends and says why."""

from __future__ import annotations

import asyncio
import json
import signal
import threading
import time
import uuid

import pytest
from live_tests import brokers
from live_tests.fake_mqtt import FakeBroker

from jeat_graph.data.errors import JeatGraphError
from jeat_graph.live.transport.ends import open_sink, open_source

PATIENCE_S = 60.0


def warnings_to(told):
    """Take lines for the user, but for those that say that there is a connection."""
    return lambda line: told.append(line) if line.startswith("warning: ") else None


def numbered(count: int, start: int = 0) -> list[bytes]:
    return [b"%d" % k for k in range(start, start + count)]


def receive(source, count: int) -> list[bytes]:
    """The next `count` messages, or as many as come."""
    found: list[bytes] = []
    end = time.monotonic() + PATIENCE_S
    while len(found) < count and time.monotonic() < end:
        message = source.receive(0.2)
        if message is not None:
            found.append(message)
            source.commit()
    return found


def send(url: str, messages: list[bytes]) -> None:
    sink = open_sink(url)
    for message in messages:
        sink.send(message)
    sink.close()


def until_it_ends(source) -> str:
    """What a source says when it ends."""
    end = time.monotonic() + PATIENCE_S
    try:
        while time.monotonic() < end:
            source.receive(0.2)
    except JeatGraphError as error:
        return str(error)
    raise AssertionError("it goes on")


def send_on(sink) -> None:
    """Send for as long as the sink takes it."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        sink.send(b"0")
        sink.flush()


@pytest.fixture(scope="module")
def nats_port(tmp_path_factory):
    pytest.importorskip("nats", reason="the client is not installed")
    server = brokers.nats_server(tmp_path_factory.mktemp("nats"))
    if server is None:
        pytest.skip("this machine has no nats-server")
    yield server.port
    server.stop()


@pytest.fixture(scope="module")
def mqtt_port(tmp_path_factory):
    pytest.importorskip("paho.mqtt", reason="the client is not installed")
    server = brokers.mosquitto(tmp_path_factory.mktemp("mqtt"))
    if server is None:
        pytest.skip("this machine has no mosquitto")
    yield server.port
    server.stop()


def jetstream(port: int, do):
    """What a coroutine gives that is called with the server's JetStream."""
    import nats

    async def work():
        client = await nats.connect(f"nats://127.0.0.1:{port}")
        try:
            return await do(client.jetstream())
        finally:
            await client.close()

    return asyncio.run(work())


@pytest.fixture
def gantries(nats_port):
    """A JetStream stream over all subjects of a name that nobody has used, and that name."""
    name = f"g{uuid.uuid4().hex}"
    jetstream(nats_port, lambda jet: jet.add_stream(name=name, subjects=[f"{name}.>"]))
    return f"nats://127.0.0.1:{nats_port}/{name}", name


class TestNats:
    @pytest.mark.parametrize(
        ("one", "other"), [("gantry6", "gantry7"), ("a/b", "a-b"), ("a", "A"), ("ä", "ö")]
    )
    def test_two_subjects_of_one_stream_each_get_their_own(self, one, other, gantries):
        url, _ = gantries
        sources = [open_source(f"{url}.{one}"), open_source(f"{url}.{other}")]
        for k in range(20):
            send(f"{url}.{one}", [b"one %d" % k])
            send(f"{url}.{other}", [b"other %d" % k])
        assert receive(sources[0], 20) == [b"one %d" % k for k in range(20)]
        assert receive(sources[1], 20) == [b"other %d" % k for k in range(20)]
        for source in sources:
            assert source.receive(0.2) is None
            source.close()

    def test_each_goes_on_where_it_was(self, gantries):
        url, _ = gantries
        send(f"{url}.a", numbered(4))
        send(f"{url}.b", numbered(4))
        for name, taken in (("a", 1), ("b", 3)):
            source = open_source(f"{url}.{name}")
            assert receive(source, taken) == numbered(taken)
            source.close()
        for name, taken in (("a", 1), ("b", 3)):
            source = open_source(f"{url}.{name}")
            assert receive(source, 4 - taken) == numbered(4 - taken, start=taken)
            source.close()

    @pytest.mark.parametrize(("one", "other"), [("a.b", "a-b"), ("x.ä", "x.ö")])
    def test_streams_that_are_made_for_subjects_alike_are_two(self, one, other, nats_port):
        begin = f"nats://127.0.0.1:{nats_port}/m{uuid.uuid4().hex}"
        for name in (one, other):
            send(f"{begin}{name}", [name.encode()])
        for name in (one, other):
            source = open_source(f"{begin}{name}")
            assert receive(source, 1) == [name.encode()]
            source.close()

    @pytest.mark.parametrize("durable", ["", "?durable=mine"])
    def test_a_consumer_in_use_is_refused_and_its_stream_goes_on(self, durable, gantries):
        url, _ = gantries
        first = open_source(f"{url}.a{durable}")
        with pytest.raises(JeatGraphError, match=r"the consumer '.*' of stream '.*' is in use") as error:
            open_source(f"{url}.a{durable}")
        assert "?durable=NAME" in str(error.value)
        send(f"{url}.a", numbered(10))
        assert receive(first, 10) == numbered(10)
        first.close()
        again = open_source(f"{url}.a{durable}")  # nobody uses it any more
        again.close()

    def test_of_some_that_start_at_once_one_gets_it(self, gantries):
        url, _ = gantries
        opened, refused = [], []

        def start() -> None:
            try:
                opened.append(open_source(f"{url}.a"))
            except JeatGraphError as error:
                refused.append(str(error))

        threads = [threading.Thread(target=start) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(PATIENCE_S)
        assert len(opened) == 1
        assert all("is in use" in text for text in refused)
        assert len(refused) == 3
        opened[0].close()

    def test_a_consumer_that_reads_another_subject_is_refused(self, gantries):
        url, name = gantries
        open_source(f"{url}.a?durable=mine").close()
        with pytest.raises(JeatGraphError, match=rf"'mine' reads '{name}\.a' of stream '{name}'"):
            open_source(f"{url}.b?durable=mine")
        send(f"{url}.a", numbered(1))
        source = open_source(f"{url}.a?durable=mine")  # and has been left as it was
        assert receive(source, 1) == numbered(1)
        source.close()

    def test_a_consumer_of_another_program_is_left_alone(self, gantries, nats_port):
        from nats.js.api import AckPolicy, ConsumerConfig

        url, name = gantries
        settings = ConsumerConfig(
            durable_name="billing", ack_policy=AckPolicy.EXPLICIT, filter_subject=f"{name}.a"
        )
        jetstream(nats_port, lambda jet: jet.add_consumer(name, settings))
        with pytest.raises(JeatGraphError, match=r"'billing' of stream '.*' was made by another program"):
            open_source(f"{url}.a?durable=billing")
        known = jetstream(nats_port, lambda jet: jet.consumer_info(name, "billing"))
        assert known.config.ack_policy == AckPolicy.EXPLICIT

    def test_a_consumer_from_which_an_older_program_reads_is_in_use(self, gantries, nats_port):
        """One that does not answer, but asks for messages again and again."""
        from nats.js.api import AckPolicy, ConsumerConfig

        url, name = gantries
        settings = ConsumerConfig(durable_name="mine", ack_policy=AckPolicy.ALL, filter_subject=f"{name}.a")
        ready, done = threading.Event(), threading.Event()

        async def read(jet) -> None:
            await jet.add_consumer(name, settings)
            pull = await jet.pull_subscribe(f"{name}.a", "mine", stream=name)
            ready.set()
            while not done.is_set():
                try:
                    await pull.fetch(1, timeout=0.5)
                except TimeoutError:
                    continue

        reader = threading.Thread(target=jetstream, args=(nats_port, read))
        reader.start()
        try:
            assert ready.wait(PATIENCE_S)
            with pytest.raises(JeatGraphError, match=r"'mine' of stream '.*' is in use"):
                open_source(f"{url}.a?durable=mine")
        finally:
            done.set()
            reader.join(PATIENCE_S)

    def test_who_did_not_answer_and_lost_its_consumer_ends_and_says_so(self, gantries, start):
        url, _ = gantries
        frozen = start("stream", "--source", f"{url}.a")
        send(f"{url}.a", [message(0)])
        frozen.stdout.readline()  # it is there
        frozen.send_signal(signal.SIGSTOP)
        time.sleep(1.0)  # what it had asked for has run out
        source = open_source(f"{url}.a")
        frozen.send_signal(signal.SIGCONT)
        assert frozen.wait(PATIENCE_S) == 2
        assert "was taken over by another stream" in frozen.stderr.read().decode().splitlines()[-1]
        send(f"{url}.a", [message(k) for k in range(1, 20)])
        found = receive(source, 1)
        while found[-1] != message(19):
            found += receive(source, 1)
        assert found in (
            [message(k) for k in range(begin, 20)] for begin in (0, 1)
        )  # 0 may not have been done
        source.close()

    def test_a_consumer_that_somebody_deletes_is_made_anew_and_told_of(self, gantries, nats_port):
        """To ask for it at once again and again took a whole processor, in silence."""
        url, name = gantries
        told: list[str] = []
        source = open_source(f"{url}.a?durable=mine", tell=warnings_to(told))
        send(f"{url}.a", numbered(5))
        assert receive(source, 5) == numbered(5)
        jetstream(nats_port, lambda jet: jet.delete_consumer(name, "mine"))
        begin = time.monotonic()
        assert source.receive(0.2) is None
        assert time.monotonic() - begin >= 0.2
        send(f"{url}.a", numbered(5, start=5))
        assert receive(source, 5) == numbered(5, start=5)
        assert len(told) == 1
        assert "the consumer 'mine' of stream" in told[0]
        source.close()

    def test_a_wrong_password_is_said_at_once(self, tmp_path):
        server = brokers.nats_server(tmp_path, "--user", "me", "--pass", "right")
        begin = time.monotonic()
        with pytest.raises(
            JeatGraphError, match=r"nats://127.0.0.1:\d+/t: .*[Aa]uthorization [Vv]iolation"
        ) as error:
            open_source(f"nats://me:hunter2@127.0.0.1:{server.port}/t")
        assert "hunter2" not in str(error.value)
        assert time.monotonic() - begin < 5.0
        open_source(f"nats://me:right@127.0.0.1:{server.port}/t").close()
        server.stop()


def message(seq: int) -> bytes:
    scan = {"t": 0.05 * seq, "sensor": "rgb", "boxes": [[100 + seq, 100, 40, 30]], "scores": [0.9]}
    return json.dumps({"v": 1, "source": "cam", "seq": seq, "scans": [scan]}).encode()


class TestMqtt:
    def test_the_older_of_two_clients_of_one_name_ends_and_says_so(self, mqtt_port):
        topic = f"mqtt://127.0.0.1:{mqtt_port}/t{uuid.uuid4().hex}?client=gantry{mqtt_port}"
        older, newer = open_source(topic), open_source(topic)
        said = until_it_ends(older)
        assert "another client is called" in said
        assert "?client=NAME" in said
        send(topic.partition("?")[0], numbered(100))
        assert receive(newer, 100) == numbered(100)  # nobody has thrown it out again
        older.close()
        newer.close()

    def test_the_older_of_two_sinks_of_one_name_ends_and_says_so(self, mqtt_port):
        topic = f"mqtt://127.0.0.1:{mqtt_port}/t{uuid.uuid4().hex}"
        older, newer = open_sink(f"{topic}?client=s"), open_sink(f"{topic}?client=s")
        with pytest.raises(JeatGraphError, match="another client is called 's'"):
            send_on(older)
        newer.send(b"1")
        newer.flush()
        newer.close()
        with pytest.raises(JeatGraphError, match="another client is called 's'"):
            older.close()

    def test_two_streams_end_as_one_with_each_message_answered(self, mqtt_port, start):
        topic = f"mqtt://127.0.0.1:{mqtt_port}/t{uuid.uuid4().hex}"
        answers, scans = open_source(f"{topic}/out"), open_sink(f"{topic}/in")
        command = ["stream", "--source", f"{topic}/in", "--sink", f"{topic}/out"]
        older = start(*command)
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end and answers.receive(0.5) is None:
            scans.send(message(0))
        answers.commit()
        newer = start(*command)
        assert older.wait(PATIENCE_S) == 2
        lines = older.stderr.read().decode().splitlines()
        assert "another client is called" in lines[-1]
        while answers.receive(0.5) is not None:
            answers.commit()
        for k in range(1, 40):
            scans.send(message(k))
        assert [json.loads(one)["of"] for one in receive(answers, 39)] == list(range(1, 40))
        newer.send_signal(signal.SIGTERM)
        assert newer.wait(PATIENCE_S) == 128 + signal.SIGTERM
        scans.close()
        answers.close()

    def test_topics_that_look_alike_do_not_throw_each_other_out(self, mqtt_port):
        begin = f"mqtt://127.0.0.1:{mqtt_port}/t{uuid.uuid4().hex}"
        names = ["a/b", "a-b", "A/b", "ä/b"]
        sources = [open_source(f"{begin}{name}") for name in names]
        for name, source in zip(names, sources, strict=True):
            send(f"{begin}{name}", [name.encode()])
            assert receive(source, 1) == [name.encode()]
            source.close()

    @pytest.mark.parametrize("old", ["a/scans", "a/+", "a/#"])
    def test_an_old_subscription_of_the_same_client_mixes_in_no_other_camera(self, old, mqtt_port):
        begin = f"mqtt://127.0.0.1:{mqtt_port}/t{uuid.uuid4().hex}"
        client = f"?client=c{uuid.uuid4().hex}"
        open_source(f"{begin}/{old}{client}").close()
        send(f"{begin}/a/scans", [b"old 0"])  # kept for the client
        told: list[str] = []
        source = open_source(f"{begin}/b/scans{client}", tell=warnings_to(told))
        for k in range(30):  # more than may be open: they do not block those that are wanted
            send(f"{begin}/a/scans", [b"old %d" % k])
            send(f"{begin}/b/scans", [b"%d" % k])
        assert receive(source, 30) == numbered(30)
        assert source.receive(0.2) is None
        assert len(told) == 1
        assert "this client once subscribed to" in told[0]
        assert "/a/scans'" in told[0]
        source.close()

    def test_without_a_reason_from_the_broker_it_ends_after_some_times_all_the_same(self, monkeypatch):
        """Brokers before MQTT 5's reasons, and proxies, end a connection without a word."""
        monkeypatch.setattr("jeat_graph.live.transport.mqtt_link._AGAIN_S", (0, 0))
        with FakeBroker(ends_after_subscription=True) as broker:
            source = open_source(f"mqtt://127.0.0.1:{broker.port}/t")
            said = until_it_ends(source)
            assert "ended the connection 5 times" in said
            assert "another client is called" in said
            assert said.endswith("(?client=NAME)")
            count = broker.connections
            time.sleep(0.5)
            assert broker.connections == count == 5  # it does not come back
            source.close()

    def test_with_a_reason_from_the_broker_it_ends_at_once(self):
        with FakeBroker(takes_over=True) as broker:
            older = open_source(f"mqtt://127.0.0.1:{broker.port}/t?client=c")
            newer = open_source(f"mqtt://127.0.0.1:{broker.port}/t?client=c")
            assert "another client is called 'c', too, and has taken this one's place" in until_it_ends(older)
            time.sleep(1.5)
            assert broker.connections == 2  # it does not come back
            assert newer.receive(0.1) is None
            older.close()
            newer.close()


class TestKafka:
    def test_a_stream_for_which_no_partition_is_left_says_so(self):
        pytest.importorskip("confluent_kafka", reason="the client is not installed")
        server = brokers.MockKafka()
        url = f"kafka://127.0.0.1:{server.port}/t{uuid.uuid4().hex}"
        send(url, numbered(20))
        told: list[str] = []
        sources = [
            open_source(url, tell=warnings_to(told)) for _ in range(6)
        ]  # more than there are partitions
        found: list[bytes] = []
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end and (not told or len(set(found)) < 20):
            for source in sources:
                one = source.receive(0.05)
                if one is not None:
                    found.append(one)
                    source.commit()
        assert sorted(set(found), key=int) == numbered(20)
        assert "have all of the topic" in told[0]
        assert "?group=NAME" in told[0]
        for source in sources:
            source.close()
        server.stop()


def test_ends_are_not_left_open(mqtt_port, start):
    """A stream that is refused ends by itself, though paho and the event loop have threads of their own."""
    url = f"mqtt://127.0.0.1:{mqtt_port}/t{uuid.uuid4().hex}"
    process = start("stream", "--source", f"{url}?client=x", "--sink", f"{url}?client=y")
    assert process.wait(PATIENCE_S) == 2
    assert "would come back as scans" in process.stderr.read().decode()
    assert process.stdout.read() == b""
