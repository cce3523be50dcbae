"""The brokers that there are."""

from __future__ import annotations

from functools import cache

from jeat_graph.data.records import records_in
from jeat_graph.live.transport.brokers.record import Broker

_PACKAGE = "jeat_graph.live.transport.brokers"


@cache
def brokers() -> dict[str, Broker]:
    """Return the records of all brokers, by the scheme of their addresses."""
    found: list[Broker] = records_in(_PACKAGE, "BROKER")
    return {one.scheme: one for one in sorted(found, key=lambda one: one.scheme)}


@cache
def secure_schemes() -> dict[str, str]:
    """Return the scheme of a broker by each one that stands for an encrypted connection to it."""
    found = {f"{scheme}+tls": scheme for scheme in brokers()}
    return found | {alias: one.scheme for one in brokers().values() for alias in one.secure_aliases}
