"""What `--frames` and `--events` may name beside files: cameras that are on now."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn
from urllib.parse import SplitResult, parse_qsl, quote, urlencode, urlsplit

from jeat_graph.data.errors import ConfigError
from jeat_graph.data.secrets import Secret, shown_url
from jeat_graph.io.event_cameras.registry import address_forms, event_cameras
from jeat_graph.io.files.credentials import PASSWORD_FILE, login_text, password_from

#: Ports of network streams that have one by themselves.
PORTS = {"rtsp": 554, "rtsps": 322, "http": 80, "https": 443, "rtmp": 1935}
_STREAMS = (*PORTS, "udp")
_DEVICE = re.compile(r"\d{1,3}|/dev/video\d+")


@dataclass(frozen=True, repr=False)
class LiveAddress:
    """A camera; shown in any way it has neither user, password nor query.

    Attributes:
        kind: `stream` (network video), `device` (a camera of this machine), or
            the scheme of an event camera.
        shown: the address as it may be shown.
        opened: what the library that opens it takes, secrets and all.
        host: name or number of the camera, empty for one of this machine.
        port: its port, or 0 where none is known.
    """

    kind: str
    shown: str
    opened: Secret
    host: str = ""
    port: int = 0

    def __str__(self) -> str:
        return self.shown

    def __repr__(self) -> str:
        return f"LiveAddress({self.shown!r})"


def is_live(text: object) -> bool:
    """Tell whether a text names a camera that is on now, and no file."""
    words = str(text)
    if _DEVICE.fullmatch(words):
        return words.startswith("/dev/") or not Path(words).exists()
    scheme, colon, rest = words.partition(":")
    if colon and scheme.lower() in event_cameras():
        return not Path(words).exists()
    return scheme.lower() in _STREAMS and rest.startswith("//")


def frames_address(text: str) -> LiveAddress:
    """Take the address of a camera of pictures apart.

    `${NAME}` in user or password is taken from the environment, and the query's `password_file=FILE` names a
    file that holds the password; the rest of the query is the camera's.

    Raises:
        ConfigError: what is wrong; never with what may be a password.
    """
    if _DEVICE.fullmatch(text):
        return LiveAddress("device", text, Secret(text))
    parts = _split(text)
    if parts.scheme.lower() not in _STREAMS:
        _refuse(text, "is a camera of events: give it as --events")
    user, password, query = _login(parts, text)
    place = parts.netloc.rpartition("@")[2]
    if user is not None:
        secret = "" if password is None else ":" + quote(password.reveal(), safe="")
        place = f"{quote(user.reveal(), safe='')}{secret}@{place}"
    opened = parts._replace(netloc=place, query=query, fragment="").geturl()
    port = _port(parts, text) or PORTS.get(parts.scheme.lower(), 0)
    return LiveAddress("stream", shown_url(text), Secret(opened), parts.hostname or "", port)


def events_address(text: str) -> LiveAddress:
    """Take the address of an event camera apart: `SCHEME:[NAME]`, or `SCHEME://HOST[:PORT]`.

    Raises:
        ConfigError: what is wrong.
    """
    scheme, _, rest = text.partition(":")
    kind = event_cameras().get(scheme.lower())
    if kind is None:
        _refuse(text, f"is no camera of events: {address_forms()} is")
    if not rest.startswith("//"):
        return LiveAddress(kind.scheme, text, Secret(rest))
    if not kind.port:
        _refuse(text, f"has no network address: {kind.forms[0]} is a camera of this machine")
    parts = _split(text)
    if parts.username or parts.password or parts.query:
        _refuse(text, "takes no user, password or option")
    port = _port(parts, text) or kind.port
    return LiveAddress(kind.scheme, shown_url(text), Secret(""), parts.hostname or "", port)


def _split(text: str) -> SplitResult:
    if not text.isprintable() or " " in text:
        _refuse(text, "an address has no spaces, line breaks or control characters")
    try:
        parts = urlsplit(text)
    except ValueError:
        _refuse(text, "the host is no name and no number")
    if not parts.hostname:
        _refuse(text, "names no host")
    if "@" in parts.path:
        # Most likely the rest of a password; to go on would show it.
        _refuse(text, "in a path @ is written %40, and in a password / is %2F, ? is %3F, % is %25")
    return parts


def _port(parts: SplitResult, text: str) -> int:
    try:
        return parts.port or 0
    except ValueError:
        _refuse(text, "the port is no number from 1 to 65535")


def _login(parts: SplitResult, text: str) -> tuple[Secret | None, Secret | None, str]:
    """Return user, password, and the query without what is not the camera's."""
    try:
        user, password = login_text(parts.username), login_text(parts.password)
    except ConfigError as error:
        _refuse(text, str(error))
    own = [value for name, value in parse_qsl(parts.query) if name == PASSWORD_FILE]
    if not own:
        return user, password, parts.query
    if user is None or password is not None or len(own) > 1:
        _refuse(text, f"{PASSWORD_FILE} goes once, with a user and without a password: user@host")
    others = [pair for pair in parse_qsl(parts.query, keep_blank_values=True) if pair[0] != PASSWORD_FILE]
    return user, password_from(own[0]), urlencode(others)


def _refuse(text: str, why: str) -> NoReturn:
    raise ConfigError(f"{shown_url(text)!r}: {why}") from None
