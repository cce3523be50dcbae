"""Where messages come from and go to, as one URL: `mqtt://user:secret@host:1883/road/scans?client=gantry7`."""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Collection
from dataclasses import dataclass
from typing import NoReturn, TypeVar
from urllib.parse import SplitResult, parse_qsl, unquote, urlsplit

from jeat_graph.data.errors import ConfigError
from jeat_graph.data.secrets import Secret, shown_url
from jeat_graph.io.files.credentials import PASSWORD_FILE, login_text, password_from
from jeat_graph.live.transport import tls
from jeat_graph.live.transport.brokers.registry import brokers, secure_schemes
from jeat_graph.live.transport.tls import Tls

#: Bound of how many messages may be open: what MQTT can say.
NUMBER_MOST = 65_535
#: Part of a machine's name between two dots.
_LABEL = re.compile(r"(?!-)[A-Za-z0-9_-]{1,63}(?<!-)")
_HOST_MOST = 253
#: So much of an address is shown (characters).
_SHOWN = 200
_Number = TypeVar("_Number", int, float)


@dataclass(frozen=True, repr=False)
class Address:
    """A topic of a broker; shown in any way it has neither user nor password.

    Attributes:
        scheme: of the broker.
        host: name or number of the broker's machine, that of IPv6 without brackets.
        port: its port.
        topic: topic (MQTT, Kafka) or subject (NATS).
        user: name to log in with, or None; a token of NATS stands here.
        password: password, or None.
        options: what stands behind the question mark.
        tls: how the connection is encrypted, or None.
    """

    scheme: str
    host: str
    port: int
    topic: str
    user: Secret | None
    password: Secret | None
    options: dict[str, str]
    tls: Tls | None = None

    @property
    def server(self) -> str:
        """`host:port`, with the brackets of IPv6."""
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"

    def __str__(self) -> str:
        return f"{self.scheme}{'' if self.tls is None else '+tls'}://{self.server}/{self.topic}"

    def __repr__(self) -> str:
        return f"Address({str(self)!r})"

    def option(self, name: str, default: str) -> str:
        """Return an option as text."""
        return self.options.get(name, default)

    def number(self, name: str, default: _Number, low: float = 0.0, high: float = NUMBER_MOST) -> _Number:
        """Return an option as a number of the default's kind, from `low` to `high`.

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
        if value is None or not low <= value <= high:
            raise ConfigError(f"{self}: {name} must be a number from {low:g} to {high:.0f}, not {text!r}")
        return value


def parse_address(url: str, known: Collection[str]) -> Address:
    """Take a URL apart.

    The password need not stand in it: `${NAME}` in user or password is taken from the environment, and the
    option `password_file` names a file that holds the password.

    Args:
        url: `SCHEME://[USER[:PASSWORD]@]HOST[:PORT]/TOPIC[?OPTION=VALUE&…]`, encrypted where the scheme ends
            in `+tls`. MQTT's `#` may stand as it is.
        known: names of the options that make sense, beside `password_file` and those of `tls`.

    Raises:
        ConfigError: what is wrong, and what would be right; never with what may be a password.
    """
    parts = _split(url)
    secure = parts.scheme in secure_schemes()
    parts = parts._replace(scheme=scheme_of(url))
    host, port = _host(parts, url), _port(parts, url, secure)
    topic = unquote(parts.path.removeprefix("/"))
    if not topic:
        _refuse(url, f"names no topic; {_example()}")
    broker = brokers()[parts.scheme]
    wrong = broker.wrong_topic(topic) if topic.isprintable() else "a topic has no control characters"
    if wrong:
        _refuse(url, f"the topic is not valid: {wrong}")
    options = _options(parts, url, (*known, *(tls.OPTIONS if secure else ())))
    try:
        encrypted = Tls.of(options) if secure else None
    except ConfigError as error:
        _refuse(url, str(error))
    user = _login(parts.username, url)
    password = _login(parts.password, url)
    file = options.pop(PASSWORD_FILE, None)
    if file is not None:
        if user is None or password is not None:
            _refuse(url, f"{PASSWORD_FILE} goes with a user and without a password: user@host")
        password = password_from(file)
    return Address(parts.scheme, host, port, topic, user, password, options, encrypted)


def scheme_of(url: str) -> str:
    """Return the scheme of the broker, encrypted or not; else what stands there."""
    scheme = url.partition(":")[0].lower()
    return secure_schemes().get(scheme, scheme)


def _example() -> str:
    return f"an address is {'|'.join(brokers())}://[user@]host[:port]/topic"


def _refuse(url: str, why: str) -> NoReturn:
    raise ConfigError(f"{_shown(url)!r}: {why}") from None


def _shown(url: str) -> str:
    shown = shown_url(url)
    return shown if len(shown) <= _SHOWN else f"{shown[:_SHOWN]}…"


def _split(url: str) -> SplitResult:
    if not url.isprintable():
        _refuse(url, "an address has no line breaks and no control characters")
    try:
        # MQTT's wild card is no fragment here.
        parts = urlsplit(url.replace("#", "%23"))
    except ValueError:
        _refuse(url, f"the host is no name and no number; {_example()}")
    if parts.scheme not in (*brokers(), *secure_schemes()):
        raise ConfigError(f"{_shown(url)!r} is no address of a broker; {_example()}")
    if "@" in parts.path or "@" in parts.query:
        # Most likely the rest of a password; to go on would show it as a topic.
        _refuse(url, "in a topic @ is written %40, and in a password / is %2F, ? is %3F, % is %25")
    return parts


def _host(parts: SplitResult, url: str) -> str:
    host = parts.hostname
    if not host:
        _refuse(url, f"names no host; {_example()}")
    try:
        if parts.netloc.rpartition("@")[2].startswith("["):
            ipaddress.IPv6Address(host)
            return host
        name = host.removesuffix(".").encode("idna").decode()
    except ValueError:  # UnicodeError is one
        name = ""
    if not name or len(name) > _HOST_MOST or not all(_LABEL.fullmatch(part) for part in name.split(".")):
        _refuse(url, f"the host is no name and no number; {_example()}")
    return host


def _port(parts: SplitResult, url: str, secure: bool) -> int:
    try:
        port = parts.port
    except ValueError:
        port = 0
    if port is None:
        broker = brokers()[parts.scheme]
        return broker.secure_port if secure else broker.port
    if port == 0:
        _refuse(url, f"the port is no number from 1 to 65535; {_example()}")
    return port


def _options(parts: SplitResult, url: str, known: Collection[str]) -> dict[str, str]:
    """Return the options; each is known, given once and not empty."""
    options: dict[str, str] = {}
    for name, value in parse_qsl(parts.query, keep_blank_values=True):
        if name in tls.OPTIONS and name not in known:
            _refuse(url, f"{name} is of an encrypted connection: write {parts.scheme}+tls://")
        if name not in (*known, PASSWORD_FILE):
            names = ", ".join((*known, PASSWORD_FILE))
            raise ConfigError(f"unknown option {name!r} in the address; known: {names}")
        if name in options:
            _refuse(url, f"the option {name} is given twice")
        if not value or (
            name not in (PASSWORD_FILE, *tls.OPTIONS) and not brokers()[parts.scheme].allows_name(value)
        ):
            _refuse(url, f"the option {name} has no value that the broker takes")
        options[name] = value
    return options


def _login(text: str | None, url: str) -> Secret | None:
    try:
        return login_text(text)
    except ConfigError as error:
        _refuse(url, str(error))
