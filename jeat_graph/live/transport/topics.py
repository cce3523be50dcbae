"""What may be a topic or a subject of each broker, what its wild cards match, and which names it allows."""

from __future__ import annotations

import re

#: Longest topic of MQTT (bytes), by its specification.
_MQTT_MOST = 65_535
_KAFKA_TOPIC = re.compile(r"[A-Za-z0-9._-]{1,249}")
_NATS_NAME = re.compile(r"[^\s.*>/\\]{1,255}")
_SHARED = "$share/"


def wrong_topic(scheme: str, topic: str) -> str:
    """Say what is wrong with a topic that is to be read, wild cards allowed; empty if nothing is.

    Args:
        scheme: `mqtt`, `nats` or `kafka`.
        topic: the topic or subject.
    """
    if not topic.isprintable():
        return "a topic has no control characters"
    if scheme == "kafka":
        fits = _KAFKA_TOPIC.fullmatch(topic) and topic not in (".", "..")
        return "" if fits else "a topic of Kafka has letters, digits, '.', '_' and '-', 249 at most"
    if scheme == "nats":
        tokens = topic.split(".")
        if any(not token or " " in token for token in tokens):
            return "a subject of NATS has words between its dots, without spaces"
        return "" if ">" not in tokens[:-1] else "'>' may only be the last word of a subject"
    if len(topic.encode("utf-8", "surrogatepass")) > _MQTT_MOST:
        return f"a topic of MQTT has {_MQTT_MOST} bytes at most"
    levels = filter_of(topic).split("/")
    if topic.startswith(_SHARED) and (topic.count("/") < 2 or not filter_of(topic) or _wild_name(topic)):
        return "a shared subscription is $share/GROUP/TOPIC"
    if any(len(level) > 1 and set(level) & {"#", "+"} for level in levels) or "#" in levels[:-1]:
        return "'+' stands for a whole level of a topic, '#' for all that follow and is the last"
    return ""


def _wild_name(topic: str) -> bool:
    """Tell whether a shared subscription's group is no name."""
    group = topic.removeprefix(_SHARED).partition("/")[0]
    return not group or bool(set(group) & {"#", "+"})


def wrong_name(scheme: str, name: str) -> bool:
    """Tell whether a broker does not allow a name of a stream, a consumer, a client or a group."""
    return not name.isprintable() or not name or (scheme == "nats" and not _NATS_NAME.fullmatch(name))


def has_wild_cards(scheme: str, topic: str) -> bool:
    """Tell whether a topic stands for more than one."""
    if scheme == "mqtt":
        return bool(set(topic) & {"#", "+"})
    return scheme == "nats" and bool({"*", ">"} & set(topic.split(".")))


def filter_of(topic: str) -> str:
    """Return what a subscription of MQTT matches: without the group of a shared one."""
    return topic.split("/", 2)[-1] if topic.startswith(_SHARED) else topic


def covers(scheme: str, wanted: str, topic: str) -> bool:
    """Tell whether a topic is one of those that a subscription stands for.

    Args:
        scheme: `mqtt`, `nats` or `kafka`.
        wanted: topic of the subscription, wild cards allowed.
        topic: a topic without wild cards.
    """
    if scheme == "kafka":
        return wanted == topic
    mqtt = scheme == "mqtt"
    one, rest, mark = ("+", "#", "/") if mqtt else ("*", ">", ".")
    words = (filter_of(wanted) if mqtt else wanted).split(mark)
    given = topic.split(mark)
    if mqtt and topic.startswith("$") and words[0] in (one, rest):
        return False  # the broker's own topics
    for k, word in enumerate(words):
        if word == rest:
            return mqtt or len(given) > k  # '#' stands for its parent too
        if k >= len(given) or word not in (one, given[k]):
            return False
    return len(words) == len(given)
