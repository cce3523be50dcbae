"""Kafka: what its topics may be, and how its ends are opened."""

from __future__ import annotations

import re

from jeat_graph.live.transport.brokers.record import Broker, opener_of

_CLIENT = "jeat_graph.live.transport.kafka"
_TOPIC = re.compile(r"[A-Za-z0-9._-]{1,249}")


def _wrong_topic(topic: str) -> str:
    fits = _TOPIC.fullmatch(topic) and topic not in (".", "..")
    return "" if fits else "a topic of Kafka has letters, digits, '.', '_' and '-', 249 at most"


BROKER = Broker(
    scheme="kafka",
    title="Kafka",
    port=9092,
    secure_port=9093,
    wrong_topic=_wrong_topic,
    covers=lambda wanted, topic: wanted == topic,
    open_source=opener_of(_CLIENT, "KafkaSource"),
    open_sink=opener_of(_CLIENT, "KafkaSink"),
    source_options=("group",),
    sink_options=("key", "most"),
    client=_CLIENT,
    extra="kafka",
)
