"""What only a server may read: a text that never shows itself, and texts with what is secret struck out."""

from __future__ import annotations

import re
from typing import NoReturn

#: What stands for a secret.
STRUCK = "***"
# A URL and what follows it up to a space or a quotation mark; each sign is looked at once or twice.
_URL = re.compile(r"(?<![A-Za-z0-9+.-])([A-Za-z][A-Za-z0-9+.-]*:/{1,2})([^\s'\"]+)")


class Secret:
    """A text that is read by `reveal` alone; printed, formatted or in a traceback it is `***`.

    Args:
        text: the secret.
    """

    __slots__ = ("_text",)

    def __init__(self, text: str) -> None:
        self._text = text

    def reveal(self) -> str:
        """Return the text itself, for whoever it is meant for."""
        return self._text

    def __repr__(self) -> str:
        return STRUCK

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Secret) and other._text == self._text

    def __hash__(self) -> int:
        return hash(self._text)

    def __reduce__(self) -> NoReturn:
        raise TypeError("a secret is not written to a file or sent to another process")


def without_logins(text: str) -> str:
    """Return a text in which the user and the password of each URL are struck out."""

    def strike(url: re.Match[str]) -> str:
        # Up to the last @: a password may hold a slash or an @ itself.
        _, at, place = url[2].rpartition("@")
        return url[1] + (STRUCK + at if at else "") + place

    return _URL.sub(strike, text)


def shown_url(url: str) -> str:
    """Return a URL, valid or not, as it may be shown: no user, password or query, no port that is no number.

    Where a password was put in the wrong place, or holds a sign that it must not, it is still struck out.
    """
    scheme, mark, rest = url.partition("://") if "://" in url else ("", "", url)
    _, at, place = rest.rpartition("@")
    host, slash, topic = place.partition("?")[0].partition("/")
    name, colon, port = host.rpartition(":")
    if colon and not host.startswith("[") and not re.fullmatch(r"\d{0,5}", port):
        host = f"{name}:{STRUCK}"
    return f"{scheme}{mark}{STRUCK + at if at else ''}{host}{slash}{topic}"
