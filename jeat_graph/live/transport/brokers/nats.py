"""NATS with JetStream: what its subjects may be, and how its ends are opened."""

from __future__ import annotations

import re

from jeat_graph.live.transport.brokers.record import Broker, opener_of
from jeat_graph.live.transport.brokers.wild_cards import matches

_CLIENT = "jeat_graph.live.transport.nats"
_NAME = re.compile(r"[^\s.*>/\\]{1,255}")


def _wrong_topic(topic: str) -> str:
    tokens = topic.split(".")
    if any(not token or " " in token for token in tokens):
        return "a subject of NATS has words between its dots, without spaces"
    return "" if ">" not in tokens[:-1] else "'>' may only be the last word of a subject"


def _covers(wanted: str, topic: str) -> bool:
    return matches(wanted.split("."), topic.split("."), "*", ">", rest_may_be_none=False)


BROKER = Broker(
    scheme="nats",
    title="NATS",
    port=4222,
    secure_port=4222,
    wrong_topic=_wrong_topic,
    covers=_covers,
    open_source=opener_of(_CLIENT, "NatsSource"),
    open_sink=opener_of(_CLIENT, "NatsSink"),
    has_wild_cards=lambda topic: bool({"*", ">"} & set(topic.split("."))),
    allows_name=lambda name: name.isprintable() and bool(_NAME.fullmatch(name)),
    source_options=("stream", "durable", "most"),
    sink_options=("stream", "most"),
    greets_first=True,
    client=_CLIENT,
    extra="nats",
)
