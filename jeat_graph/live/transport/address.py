"""Where messages come from and go to, as one URL: `mqtt://user:secret@host:1883/road/scans?client=gantry7`."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import TypeVar
from urllib.parse import parse_qsl, unquote, urlsplit

from jeat_graph.data.errors import ConfigError

PORTS = {"mqtt": 1883, "nats": 4222, "kafka": 9092}
_Number = TypeVar("_Number", int, float)


@dataclass(frozen=True)
class Address:
    """A topic of a broker.

    Attributes:
        scheme: `mqtt`, `nats` or `kafka`.
        host: name or number of the broker's machine.
        port: its port.
        topic: topic (MQTT, Kafka) or subject (NATS).
        user: name to log in with, or None.
        password: password, or None.
        options: what stands behind the question mark.
    """

    scheme: str
    host: str
    port: int
    topic: str
    user: str | None
    password: str | None
    options: dict[str, str]

    def __str__(self) -> str:
        # For messages: without the password.
        return f"{self.scheme}://{self.host}:{self.port}/{self.topic}"

    def option(self, name: str, default: str) -> str:
        """Return an option as text."""
        return self.options.get(name, default)

    def number(self, name: str, default: _Number, low: float = 0.0) -> _Number:
        """Return an option as a number of the default's kind, at least `low`.

        Raises:
            ConfigError: it is no such number.
        """
        text = self.options.get(name)
        if text is None:
            return default
        try:
            value = type(default)(text)
        except ValueError:
            value = None
        if value is None or not low <= value < float("inf"):
            raise ConfigError(f"{self}: {name} must be a number of at least {low:g}, not {text!r}")
        return value


def parse_address(url: str, known: Collection[str]) -> Address:
    """Take an URL apart.

    Args:
        url: `SCHEME://[USER:PASSWORD@]HOST[:PORT]/TOPIC[?OPTION=VALUE&…]`. MQTT's `#` may stand as it is.
        known: names of the options that make sense.

    Raises:
        ConfigError: what is wrong, and what would be right.
    """
    example = f"an address is {'|'.join(PORTS)}://host[:port]/topic"
    # MQTT's wild card is no fragment here.
    parts = urlsplit(url.replace("#", "%23"))
    if parts.scheme not in PORTS:
        raise ConfigError(f"{url!r} is no address of a broker; {example}")
    try:
        port = parts.port or PORTS[parts.scheme]
    except ValueError:
        raise ConfigError(f"{url!r}: the port is no number; {example}") from None
    topic = unquote(parts.path.removeprefix("/"))
    if not parts.hostname or not topic:
        raise ConfigError(f"{url!r} names no {'topic' if parts.hostname else 'host'}; {example}")
    options = dict(parse_qsl(parts.query, keep_blank_values=True))
    strange = next((name for name in options if name not in known), None)
    if strange is not None:
        raise ConfigError(f"unknown option {strange!r} in the address; known: {', '.join(known) or 'none'}")
    user = unquote(parts.username) if parts.username else None
    password = unquote(parts.password) if parts.password else None
    return Address(parts.scheme, parts.hostname, port, topic, user, password, options)
