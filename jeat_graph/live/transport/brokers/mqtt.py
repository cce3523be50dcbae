"""MQTT: what its topics may be, and how its ends are opened."""

from __future__ import annotations

from jeat_graph.live.transport.brokers.record import Broker, opener_of
from jeat_graph.live.transport.brokers.wild_cards import matches

_CLIENT = "jeat_graph.live.transport.mqtt"
#: Longest topic (bytes), by the specification.
_MOST = 65_535
_SHARED = "$share/"


def _wrong_topic(topic: str) -> str:
    if len(topic.encode("utf-8", "surrogatepass")) > _MOST:
        return f"a topic of MQTT has {_MOST} bytes at most"
    levels = _filter_of(topic).split("/")
    if topic.startswith(_SHARED) and (topic.count("/") < 2 or not _filter_of(topic) or _wild_name(topic)):
        return "a shared subscription is $share/GROUP/TOPIC"
    if any(len(level) > 1 and set(level) & {"#", "+"} for level in levels) or "#" in levels[:-1]:
        return "'+' stands for a whole level of a topic, '#' for all that follow and is the last"
    return ""


def _wild_name(topic: str) -> bool:
    """Tell whether a shared subscription's group is no name."""
    group = topic.removeprefix(_SHARED).partition("/")[0]
    return not group or bool(set(group) & {"#", "+"})


def _filter_of(topic: str) -> str:
    """Return what a subscription matches: without the group of a shared one."""
    return topic.split("/", 2)[-1] if topic.startswith(_SHARED) else topic


def _covers(wanted: str, topic: str) -> bool:
    words = _filter_of(wanted).split("/")
    if topic.startswith("$") and words[0] in ("+", "#"):
        return False  # the broker's own topics
    return matches(words, topic.split("/"), "+", "#", rest_may_be_none=True)  # '#' stands for its parent too


BROKER = Broker(
    scheme="mqtt",
    title="MQTT",
    port=1883,
    secure_port=8883,
    wrong_topic=_wrong_topic,
    covers=_covers,
    open_source=opener_of(_CLIENT, "MqttSource"),
    open_sink=opener_of(_CLIENT, "MqttSink"),
    has_wild_cards=lambda topic: bool(set(topic) & {"#", "+"}),
    source_options=("client", "most"),
    sink_options=("client", "most", "largest"),
    secure_aliases=("mqtts",),
    client=_CLIENT,
    extra="mqtt",
)
