"""The two ends that the stream knows: a source of messages and a sink for them, whatever the broker."""

from __future__ import annotations

from typing import Protocol

from jeat_graph.data.errors import ConfigError, JeatGraphError
from jeat_graph.data.extras import install
from jeat_graph.live.transport.address import parse_address
from jeat_graph.live.transport.patience import Overdue, never

SOURCE_OPTIONS = {"mqtt": ("client", "most"), "nats": ("stream", "durable", "most"), "kafka": ("group",)}
SINK_OPTIONS = {"mqtt": ("client", "most"), "nats": ("stream", "most"), "kafka": ("key", "most")}


class Source(Protocol):
    """Messages in the order in which the broker has them, each at least once.

    What was received and not committed is delivered again after a crash or a lost connection. The broker
    holds back what is beyond `most_open` messages, so a slow tracker is never flooded.

    Attributes:
        most_open: so many messages may be received and not committed; then none comes until `commit`.
    """

    most_open: int

    def receive(self, timeout_s: float) -> bytes | None:
        """Wait for the next message; None if none came in that time, or the connection is being mended."""

    def commit(self) -> None:
        """Tell the broker that all that was received need not come again."""

    def close(self) -> None:
        """Leave; what is not committed will come again."""


class Sink(Protocol):
    """Takes messages; waits where the broker is slower than they come."""

    def send(self, message: bytes) -> None:
        """Hand over a message; waits while too many are on their way.

        Raises:
            JeatGraphError: the broker refuses messages for good.
            UnconfirmedError: the program is to end; the message was not sent.
        """

    def flush(self) -> None:
        """Wait until the broker has confirmed all that was sent.

        Raises:
            JeatGraphError: the broker refused one of them.
            UnconfirmedError: the program is to end, and the broker has not.
        """

    def close(self) -> None:
        """Flush and leave; what the broker does not confirm before the program is to end is given up."""


def open_source(url: str, overdue: Overdue = never) -> Source:
    """Open the source at an address.

    Args:
        url: the address.
        overdue: tells when the program is to end; then nothing is waited for any longer.

    Raises:
        ConfigError: the address is not valid.
        JeatGraphError: the client's package is missing, or nobody answers at the address.
    """
    scheme = url.partition(":")[0]
    address = parse_address(url, SOURCE_OPTIONS.get(scheme, ()))
    try:
        if address.scheme == "mqtt":
            from jeat_graph.live.transport.mqtt import MqttSource

            return MqttSource(address, overdue)
        if address.scheme == "nats":
            from jeat_graph.live.transport.nats import NatsSource

            return NatsSource(address, overdue)
        from jeat_graph.live.transport.kafka import KafkaSource

        return KafkaSource(address)
    except ImportError as error:
        raise _missing(scheme, error) from None


def open_sink(url: str, overdue: Overdue = never) -> Sink:
    """Open the sink at an address.

    Args:
        url: the address.
        overdue: tells when the program is to end; then nothing is waited for any longer.

    Raises:
        ConfigError: the address is not valid.
        JeatGraphError: the client's package is missing, or nobody answers at the address.
    """
    scheme = url.partition(":")[0]
    address = parse_address(url, SINK_OPTIONS.get(scheme, ()))
    if set(address.topic) & set("#+*>"):
        raise ConfigError(f"{address}: tracks go to one topic, without wild cards")
    try:
        if address.scheme == "mqtt":
            from jeat_graph.live.transport.mqtt import MqttSink

            return MqttSink(address, overdue)
        if address.scheme == "nats":
            from jeat_graph.live.transport.nats import NatsSink

            return NatsSink(address, overdue)
        from jeat_graph.live.transport.kafka import KafkaSink

        return KafkaSink(address, overdue)
    except ImportError as error:
        raise _missing(scheme, error) from None


def _missing(scheme: str, error: ImportError) -> JeatGraphError:
    return JeatGraphError(f"{scheme}:// needs a package more: {install(scheme)} ({error})")
