"""The two ends that the stream knows: a source of messages and a sink for them, whatever the broker."""

from __future__ import annotations

import ipaddress
from importlib import import_module
from typing import Protocol

from jeat_graph.data.errors import ConfigError
from jeat_graph.data.extras import install
from jeat_graph.live.transport.address import Address, parse_address, scheme_of
from jeat_graph.live.transport.notices import Notices, Tell, say_nothing
from jeat_graph.live.transport.patience import Overdue, never
from jeat_graph.live.transport.topics import covers, has_wild_cards

SOURCE_OPTIONS = {"mqtt": ("client", "most"), "nats": ("stream", "durable", "most"), "kafka": ("group",)}
SINK_OPTIONS = {"mqtt": ("client", "most", "largest"), "nats": ("stream", "most"), "kafka": ("key", "most")}


class Source(Protocol):
    """Messages in the order in which the broker has them, each at least once.

    What was received and not committed is delivered again after a crash or a lost connection. The broker
    holds back what is beyond `most_open` messages, so a slow tracker is never flooded.

    Attributes:
        address: where it reads.
        most_open: so many messages may be received and not committed; then none comes until `commit`.
    """

    address: Address
    most_open: int

    def receive(self, timeout_s: float) -> bytes | None:
        """Wait for the next message; None if none came in that time, or the connection is being mended.

        Raises:
            JeatGraphError: no more will come: another program reads in this one's place, or the like.
        """

    def commit(self) -> None:
        """Tell the broker that all that was received need not come again."""

    def close(self) -> None:
        """Leave; what is not committed will come again."""


class Sink(Protocol):
    """Takes messages; waits where the broker is slower than they come.

    One that is larger than the broker takes is not sent, told of and counted: to send it again is no help.

    Attributes:
        address: where it writes.
        too_large: messages that were not sent because of their size.
    """

    address: Address

    @property
    def too_large(self) -> int:
        """Messages that were not sent because of their size."""

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


def source_address(url: str) -> Address:
    """Take the address of a source apart.

    Raises:
        ConfigError: it is not valid.
    """
    return parse_address(url, SOURCE_OPTIONS.get(scheme_of(url), ()))


def sink_address(url: str) -> Address:
    """Take the address of a sink apart.

    Raises:
        ConfigError: it is not valid.
    """
    address = parse_address(url, SINK_OPTIONS.get(scheme_of(url), ()))
    if has_wild_cards(address.scheme, address.topic):
        raise ConfigError(f"{address}: tracks go to one topic, without wild cards")
    return address


def check_addresses(source: str | None, sink: str | None) -> None:
    """See that the ends of one stream are valid, and not in each other's way; connects to nobody.

    Args:
        source: address of the scans, if they come from a broker.
        sink: address of the tracks, if they go to one.

    Raises:
        ConfigError: an address is not valid, the tracks would come back as scans, or both ends have one
            name at a broker that throws out the older of two such clients.
    """
    one = None if source is None else source_address(source)
    other = None if sink is None else sink_address(sink)
    if one is None or other is None or (one.scheme, one.server) != (other.scheme, other.server):
        return
    if covers(one.scheme, one.topic, other.topic):
        raise ConfigError(f"{one}: the tracks that go to {other.topic!r} would come back as scans")
    client = one.options.get("client")
    if client is not None and client == other.options.get("client"):
        raise ConfigError(f"{one}: source and sink are both called client={client}; names must differ")


def check_client(scheme: str) -> None:
    """See that the client of a broker is installed; connects to nobody.

    Args:
        scheme: of the address: `mqtt`, `nats` or `kafka`.

    Raises:
        ConfigError: its package is missing.
    """
    try:
        import_module(f"{__package__}.{scheme}")
    except ImportError as error:
        raise ConfigError(f"{scheme}:// needs a package more: {install(scheme)} ({error})") from None


def open_source(
    url: str, overdue: Overdue = never, tell: Tell = say_nothing, notices: Notices | None = None
) -> Source:
    """Open the source at an address.

    Args:
        url: the address.
        overdue: tells when the program is to end; then nothing is waited for any longer.
        tell: takes each line for the user; called by whoever calls the source.
        notices: takes them instead of `tell`, and knows whether there is a connection.

    Raises:
        ConfigError: the address is not valid, or the client's package is missing.
        JeatGraphError: nobody answers at the address.
    """
    address = source_address(url)
    notices = _before_opening(address, notices or Notices(tell))
    if address.scheme == "mqtt":
        from jeat_graph.live.transport.mqtt import MqttSource

        return MqttSource(address, overdue, notices)
    if address.scheme == "nats":
        from jeat_graph.live.transport.nats import NatsSource

        return NatsSource(address, overdue, notices)
    from jeat_graph.live.transport.kafka import KafkaSource

    return KafkaSource(address, overdue, notices)


def open_sink(
    url: str, overdue: Overdue = never, tell: Tell = say_nothing, notices: Notices | None = None
) -> Sink:
    """Open the sink at an address.

    Args:
        url: the address.
        overdue: tells when the program is to end; then nothing is waited for any longer.
        tell: takes each line for the user; called by whoever calls the sink.
        notices: takes them instead of `tell`, and knows whether there is a connection.

    Raises:
        ConfigError: the address is not valid, or the client's package is missing.
        JeatGraphError: nobody answers at the address.
    """
    address = sink_address(url)
    notices = _before_opening(address, notices or Notices(tell))
    if address.scheme == "mqtt":
        from jeat_graph.live.transport.mqtt import MqttSink

        return MqttSink(address, overdue, notices)
    if address.scheme == "nats":
        from jeat_graph.live.transport.nats import NatsSink

        return NatsSink(address, overdue, notices)
    from jeat_graph.live.transport.kafka import KafkaSink

    return KafkaSink(address, overdue, notices)


def _before_opening(address: Address, notices: Notices) -> Notices:
    """Warn of a connection that is not secure, and check that the client's package is there."""
    _warn_of(address, notices)
    check_client(address.scheme)
    return notices


def _warn_of(address: Address, notices: Notices) -> None:
    """Say loudly what others on the way could do."""
    if address.tls is not None and address.tls.insecure:
        notices.add(
            f"warning: {address}: INSECURE: the broker's certificate is not looked at, and whoever is on the "
            "way can read and change everything; give ca=FILE instead of insecure=yes"
        )
    if address.tls is None and address.password is not None and not _is_here(address.host):
        notices.add(
            f"warning: {address}: the password goes over the network unencrypted; {address.scheme}+tls:// "
            "encrypts"
        )


def _is_here(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
