"""Kafka by way of librdkafka: a consumer group whose place is committed by hand, an idempotent producer."""

from __future__ import annotations

import contextlib
import time
from typing import Any

from confluent_kafka import Consumer, KafkaError, KafkaException, Producer, TopicPartition

from jeat_graph.data.errors import JeatGraphError
from jeat_graph.live.transport.address import Address
from jeat_graph.live.transport.brokers.record import Sink, Source
from jeat_graph.live.transport.notices import Notices
from jeat_graph.live.transport.patience import SLICE_S, Overdue, UnconfirmedError, check, never

#: Kafka itself sets no bound to what is received and not committed; the stream commits at least so often.
MOST_OPEN = 4096
_CONNECT_S = 10.0
#: Pauses between looks for a broker that does not answer, and longest wait for one (s).
_CHECK_S, _ASK_S = 5.0, 0.5
#: Errors that do not pass by themselves.
_FOR_GOOD = (KafkaError.TOPIC_AUTHORIZATION_FAILED, KafkaError.GROUP_AUTHORIZATION_FAILED)
#: How soon the group takes a member for dead that does not answer (ms): a restart should not wait longer.
_SESSION_MS = 6000
#: How soon a topic that is made later is seen (ms).
_REFRESH_MS = 2000
#: The client's own bound of a message (bytes): what the broker takes is the broker's to say.
_MESSAGE_MOST = 128 * 2**20


def _settings(address: Address, notices: Notices) -> dict[str, Any]:
    def on_error(error: KafkaError) -> None:
        # It mends connections by itself; what is for good stands in the messages.
        if error.code() == KafkaError._ALL_BROKERS_DOWN:
            notices.lost(address, "no broker answers")

    settings: dict[str, Any] = {
        "bootstrap.servers": address.server,
        "log_level": 0,
        "error_cb": on_error,
        "security.protocol": "plaintext" if address.tls is None else "ssl",
    }
    if address.tls is not None:
        settings |= address.tls.librdkafka()
    if address.user is not None:
        settings |= {
            "security.protocol": "sasl_plaintext" if address.tls is None else "sasl_ssl",
            "sasl.mechanism": "PLAIN",
            "sasl.username": address.user.reveal(),
            "sasl.password": "" if address.password is None else address.password.reveal(),
        }
    return settings


def _reach(client: Any, address: Address, notices: Notices) -> None:
    try:
        client.list_topics(timeout=_CONNECT_S)
    except KafkaException as error:
        raise JeatGraphError(f"{address}: {error.args[0].str()}") from None
    notices.found(address)


class KafkaSource(Source):
    """Messages of a topic, as a member of a group (see `record.Source`); order holds within a partition.

    Members of one group share the topic's partitions; one for which none is left gets a notice.

    Args:
        address: option `group` (default `jeat-graph.TOPIC`).
        overdue: tells when the program is to end; not asked here, since no wait is that long.
        notices: takes what the user is to know.

    Raises:
        JeatGraphError: nobody answers.
    """

    def __init__(self, address: Address, overdue: Overdue = never, notices: Notices | None = None) -> None:
        self.most_open = MOST_OPEN
        self.address = address
        self._notices = notices or Notices()
        self._check_at = 0.0
        self._next: dict[tuple[str, int], int] = {}
        self._group = address.option("group", f"jeat-graph.{address.topic}")
        self._consumer = Consumer(
            _settings(address, self._notices)
            | {
                "group.id": self._group,
                "enable.auto.commit": False,
                "session.timeout.ms": _SESSION_MS,
                "auto.offset.reset": "earliest",
                "allow.auto.create.topics": True,
                "topic.metadata.refresh.interval.ms": _REFRESH_MS,
            }
        )
        _reach(self._consumer, address, self._notices)
        self._consumer.subscribe(
            [address.topic], on_assign=self._on_assign, on_revoke=self._on_revoke, on_lost=self._on_revoke
        )

    def _on_assign(self, consumer: Any, partitions: list[TopicPartition]) -> None:
        if partitions:
            self._notices.forget()
            return
        with contextlib.suppress(KafkaException):
            if (
                consumer.list_topics(self.address.topic, timeout=_CONNECT_S)
                .topics[self.address.topic]
                .partitions
            ):
                self._notices.once(
                    f"warning: {self.address}: other members of the group {self._group!r} have all of the "
                    "topic, so nothing comes here; a stream of its own needs ?group=NAME"
                )

    def _on_revoke(self, consumer: Any, partitions: list[TopicPartition]) -> None:
        # What comes to another member now is not ours to acknowledge: to try would fail for the rest, too.
        for lost in partitions:
            self._next.pop((lost.topic, lost.partition), None)

    def receive(self, timeout_s: float) -> bytes | None:
        """Wait for the next message.

        Raises:
            JeatGraphError: an error that will not pass by itself.
        """
        end = time.monotonic() + timeout_s
        while True:
            message: Any = self._consumer.poll(max(end - time.monotonic(), 0.0))
            self._notices.tell()
            if message is None:
                self._check_broker()
                return None
            error = message.error()
            if error is None:
                break
            if error.fatal() or error.code() in _FOR_GOOD:
                raise JeatGraphError(f"{self.address}: {error.str()}")
        self._notices.found(self.address)
        self._next[message.topic(), message.partition()] = message.offset() + 1
        return bytes(message.value() or b"")

    def _check_broker(self) -> None:
        """See whether a broker that did not answer is back, which a topic without messages does not show."""
        now = time.monotonic()
        if self._notices.connected or now < self._check_at:
            return
        self._check_at = now + _CHECK_S
        with contextlib.suppress(KafkaException):
            self._consumer.list_topics(self.address.topic, timeout=_ASK_S)
            self._notices.found(self.address)

    def commit(self) -> None:
        """Move the group's place behind all that was received."""
        if not self._next:
            return
        places = [TopicPartition(topic, part, offset) for (topic, part), offset in self._next.items()]
        try:
            self._consumer.commit(offsets=places, asynchronous=False)
        except KafkaException:
            return  # the group's partitions are being shared out again: the next commit counts
        self._next = {}

    def close(self) -> None:
        """Leave the group."""
        self._consumer.close()


class KafkaSink(Sink):
    """Produces to a topic, each message once and in order (see `record.Sink`).

    All messages have one key and so come to one partition: only within a partition does order hold.

    Args:
        address: options `key`, `most` (messages on their way at a time).
        overdue: tells when the program is to end.
        notices: takes what the user is to know.

    Raises:
        JeatGraphError: nobody answers.
    """

    def __init__(self, address: Address, overdue: Overdue = never, notices: Notices | None = None) -> None:
        self.address, self._overdue = address, overdue
        self._notices = notices or Notices()
        self._most = address.number("most", MOST_OPEN, low=1)
        self._key = address.option("key", "tracks")
        self._refused = ""
        self._producer = Producer(
            _settings(address, self._notices)
            | {"enable.idempotence": True, "linger.ms": 2, "message.max.bytes": _MESSAGE_MOST}
        )
        _reach(self._producer, address, self._notices)

    @property
    def too_large(self) -> int:
        """Messages that were not sent because of their size."""
        return self._notices.too_large

    def send(self, message: bytes) -> None:
        """Produce; waits while too many are on their way."""
        while len(self._producer) >= self._most:
            self._producer.poll(SLICE_S)
            self._check()
            check(self._overdue, self.address)
        try:
            self._producer.produce(self.address.topic, message, self._key, on_delivery=self._delivered)
        except KafkaException as error:
            if error.args[0].code() != KafkaError.MSG_SIZE_TOO_LARGE:
                raise JeatGraphError(f"{self.address}: tracks were refused: {error.args[0].str()}") from None
            self._notices.larger(self.address, len(message), _MESSAGE_MOST)
        self._producer.poll(0)
        self._check()

    def flush(self) -> None:
        """Wait until all are confirmed."""
        while self._producer.flush(SLICE_S):
            self._check()
            check(self._overdue, self.address)
        self._check()

    def _delivered(self, error: Any, message: Any) -> None:
        if error is None:
            self._notices.found(self.address)
            return
        if error.code() == KafkaError.MSG_SIZE_TOO_LARGE:
            self._notices.larger(self.address, len(message.value() or b""), None)
        else:
            self._refused = error.str()

    def _check(self) -> None:
        self._notices.tell()
        if self._refused:
            raise JeatGraphError(f"{self.address}: tracks were refused: {self._refused}")

    def close(self) -> None:
        """Flush; the producer ends with this object."""
        try:
            self.flush()
        except UnconfirmedError:
            self._producer.purge()  # the producer's own end would wait for them
