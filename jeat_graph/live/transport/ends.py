"""The two ends that the stream knows: a source of messages and a sink for them, whatever the broker."""

from __future__ import annotations

import ipaddress
from importlib import import_module

from jeat_graph.data.errors import ConfigError
from jeat_graph.data.extras import install
from jeat_graph.live.transport.address import Address, parse_address, scheme_of
from jeat_graph.live.transport.brokers.record import Sink, Source
from jeat_graph.live.transport.brokers.registry import brokers
from jeat_graph.live.transport.notices import Notices, Tell, say_nothing
from jeat_graph.live.transport.patience import Overdue, never


def source_address(url: str) -> Address:
    """Take the address of a source apart.

    Raises:
        ConfigError: it is not valid.
    """
    broker = brokers().get(scheme_of(url))
    return parse_address(url, () if broker is None else broker.source_options)


def sink_address(url: str) -> Address:
    """Take the address of a sink apart.

    Raises:
        ConfigError: it is not valid.
    """
    broker = brokers().get(scheme_of(url))
    address = parse_address(url, () if broker is None else broker.sink_options)
    if brokers()[address.scheme].has_wild_cards(address.topic):
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
    if brokers()[one.scheme].covers(one.topic, other.topic):
        raise ConfigError(f"{one}: the tracks that go to {other.topic!r} would come back as scans")
    client = one.options.get("client")
    if client is not None and client == other.options.get("client"):
        raise ConfigError(f"{one}: source and sink are both called client={client}; names must differ")


def check_client(scheme: str) -> None:
    """See that the client of a broker is installed; connects to nobody.

    Args:
        scheme: of the address.

    Raises:
        ConfigError: its package is missing.
    """
    broker = brokers()[scheme]
    if broker.client is None:
        return
    try:
        import_module(broker.client)
    except ImportError as error:
        how = "" if broker.extra is None else f": {install(broker.extra)}"
        raise ConfigError(f"{scheme}:// needs a package more{how} ({error})") from None


def open_source(
    url: str, overdue: Overdue = never, tell: Tell = say_nothing, notices: Notices | None = None
) -> Source:
    """Open the source at an address.

    Args:
        url: the address.
        overdue: tells when the program is to end; then nothing is waited for any longer.
        tell: takes each line for the user; called by whoever calls the source or sink.
        notices: takes them instead of `tell`, and knows whether there is a connection.

    Raises:
        ConfigError: the address is not valid, or the client's package is missing.
        JeatGraphError: nobody answers at the address.
    """
    address = source_address(url)
    notices = _before_opening(address, notices or Notices(tell))
    return brokers()[address.scheme].open_source(address, overdue, notices)


def open_sink(
    url: str, overdue: Overdue = never, tell: Tell = say_nothing, notices: Notices | None = None
) -> Sink:
    """Open the sink at an address; arguments and errors as of `open_source`."""
    address = sink_address(url)
    notices = _before_opening(address, notices or Notices(tell))
    return brokers()[address.scheme].open_sink(address, overdue, notices)


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
