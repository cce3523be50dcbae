"""NATS with JetStream: what its subjects may be, and how its ends are opened."""

from __future__ import annotations

import re

from jeat_graph.live.transport.address import Address
from jeat_graph.live.transport.brokers.record import Broker, Sink, Source
from jeat_graph.live.transport.brokers.wild_cards import matches
from jeat_graph.live.transport.notices import Notices
from jeat_graph.live.transport.patience import Overdue

_NAME = re.compile(r"[^\s.*>/\\]{1,255}")


def _wrong_topic(topic: str) -> str:
    tokens = topic.split(".")
    if any(not token or " " in token for token in tokens):
        return "a subject of NATS has words between its dots, without spaces"
    return "" if ">" not in tokens[:-1] else "'>' may only be the last word of a subject"


def _covers(wanted: str, topic: str) -> bool:
    return matches(wanted.split("."), topic.split("."), "*", ">", rest_may_be_none=False)


def _source(address: Address, overdue: Overdue, notices: Notices) -> Source:
    from jeat_graph.live.transport.nats import NatsSource

    return NatsSource(address, overdue, notices)


def _sink(address: Address, overdue: Overdue, notices: Notices) -> Sink:
    from jeat_graph.live.transport.nats import NatsSink

    return NatsSink(address, overdue, notices)


BROKER = Broker(
    scheme="nats",
    title="NATS",
    port=4222,
    secure_port=4222,
    wrong_topic=_wrong_topic,
    covers=_covers,
    open_source=_source,
    open_sink=_sink,
    has_wild_cards=lambda topic: bool({"*", ">"} & set(topic.split("."))),
    allows_name=lambda name: name.isprintable() and bool(_NAME.fullmatch(name)),
    source_options=("stream", "durable", "most"),
    sink_options=("stream", "most"),
    greets_first=True,
    client="jeat_graph.live.transport.nats",
    extra="nats",
)
