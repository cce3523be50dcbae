"""Kafka: what its topics may be, and how its ends are opened."""

from __future__ import annotations

import re

from jeat_graph.live.transport.address import Address
from jeat_graph.live.transport.brokers.record import Broker, Sink, Source
from jeat_graph.live.transport.notices import Notices
from jeat_graph.live.transport.patience import Overdue

_TOPIC = re.compile(r"[A-Za-z0-9._-]{1,249}")


def _wrong_topic(topic: str) -> str:
    fits = _TOPIC.fullmatch(topic) and topic not in (".", "..")
    return "" if fits else "a topic of Kafka has letters, digits, '.', '_' and '-', 249 at most"


def _source(address: Address, overdue: Overdue, notices: Notices) -> Source:
    from jeat_graph.live.transport.kafka import KafkaSource

    return KafkaSource(address, overdue, notices)


def _sink(address: Address, overdue: Overdue, notices: Notices) -> Sink:
    from jeat_graph.live.transport.kafka import KafkaSink

    return KafkaSink(address, overdue, notices)


BROKER = Broker(
    scheme="kafka",
    title="Kafka",
    port=9092,
    secure_port=9093,
    wrong_topic=_wrong_topic,
    covers=lambda wanted, topic: wanted == topic,
    open_source=_source,
    open_sink=_sink,
    source_options=("group",),
    sink_options=("key", "most"),
    client="jeat_graph.live.transport.kafka",
    extra="kafka",
)
