"""What a broker's client notices in a thread of its own and the user is to know."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

#: Takes one line for the user.
Tell = Callable[[str], object]
#: So many things of a kind are reported one by one; the rest is counted.
MOST_WARNED = 5


def say_nothing(_: str) -> None:
    """Tell nobody."""


class Notices:
    """Lines for the user from any thread, reported in the thread that asks for them.

    Args:
        tell: takes each line.

    Attributes:
        too_large: messages that the broker does not take, and which were not sent.
        connected: whether there is a connection now.
        reconnects: how often it was mended.
    """

    def __init__(self, tell: Tell = say_nothing) -> None:
        self.too_large = 0
        self.connected = False
        self.reconnects = 0
        self._lost_at: float | None = None
        self._tell = tell
        self._lines: deque[str] = deque()
        self._known: set[str] = set()

    def add(self, line: str) -> None:
        """Keep a line until `tell`."""
        self._lines.append(line)

    def once(self, line: str) -> None:
        """Keep a line that is reported once, until `forget`."""
        if line not in self._known:
            self._known.add(line)
            self.add(line)

    def forget(self) -> None:
        """Let what was reported once be reported again: it was over meanwhile."""
        self._known.clear()

    def found(self, where: object) -> None:
        """Keep that there is a connection, for the first time or again."""
        if self.connected:
            return
        self.connected = True
        if self._lost_at is None:
            self.add(f"{where}: connected")
            return
        self.reconnects += 1
        self.add(f"{where}: connected again, after {time.monotonic() - self._lost_at:.1f} s")

    def lost(self, where: object, why: str = "") -> None:
        """Keep that the connection is lost, and is being mended."""
        if self.connected:
            self.connected, self._lost_at = False, time.monotonic()
            reason = f" ({why})" if why else ""
            self.add(f"warning: {where}: the connection is lost{reason}; trying again until it is back")

    def larger(self, where: object, size: int, most: int | None) -> None:
        """Keep that a message was not sent because it is larger than the broker takes.

        Args:
            where: the address.
            size: of the message (bytes).
            most: what the broker takes (bytes), or None if it does not say.
        """
        self.too_large += 1
        if self.too_large <= MOST_WARNED:
            bound = "takes" if most is None else f"takes ({most})"
            more = "; further ones are only counted" if self.too_large == MOST_WARNED else ""
            self.add(
                f"warning: {where}: an answer of {size} bytes is larger than the broker {bound} and was not "
                f"sent; raise the broker's bound{more}"
            )

    def tell(self) -> None:
        """Tell all that has been noticed."""
        while self._lines:
            self._tell(self._lines.popleft())
