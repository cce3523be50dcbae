"""What a broker is: one record, in the one file that knows its topics and opens its ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from jeat_graph.live.transport.address import Address
    from jeat_graph.live.transport.notices import Notices
    from jeat_graph.live.transport.patience import Overdue


class Source(Protocol):
    """Messages in the order in which the broker has them, each at least once.

    What was received and not committed is delivered again after a crash or a lost connection. The broker
    holds back what is beyond `most_open` messages, so a slow tracker is never flooded.

    Attributes:
        address: where it reads.
        most_open: so many messages may be received and not committed; then none comes until `commit`.
    """

    address: Address
    most_open: int

    def receive(self, timeout_s: float) -> bytes | None:
        """Wait for the next message; None if none came in that time, or the connection is being mended.

        Raises:
            JeatGraphError: no more will come: another program reads in this one's place, or the like.
        """
        ...

    def commit(self) -> None:
        """Tell the broker that all that was received need not come again."""

    def close(self) -> None:
        """Leave; what is not committed will come again."""


class Sink(Protocol):
    """Takes messages; waits where the broker is slower than they come.

    One that is larger than the broker takes is not sent, but reported and counted: to send it again is no
    help.

    Attributes:
        address: where it writes.
        too_large: messages that were not sent because of their size.
    """

    address: Address

    @property
    def too_large(self) -> int:
        """Messages that were not sent because of their size."""
        ...

    def send(self, message: bytes) -> None:
        """Hand over a message; waits while too many are on their way.

        Raises:
            JeatGraphError: the broker refuses messages for good.
            UnconfirmedError: the program is to end; the message was not sent.
        """

    def flush(self) -> None:
        """Wait until the broker has confirmed all that was sent.

        Raises:
            JeatGraphError: the broker refused one of them.
            UnconfirmedError: the program is to end, and the broker has not.
        """

    def close(self) -> None:
        """Flush and leave; what the broker does not confirm before the program is to end is given up."""


def any_name(name: str) -> bool:
    """Tell that a printable name is allowed."""
    return bool(name) and name.isprintable()


def opener_of(client: str, name: str) -> Callable[[Address, Overdue, Notices], Any]:
    """Return what opens an end of a broker whose client's package need not be installed.

    Args:
        client: module that needs the package; it is imported when the first end is opened.
        name: its class, a `Source` or a `Sink`.
    """
    return lambda *given: getattr(import_module(client), name)(*given)


@dataclass(frozen=True)
class Broker:
    """A kind of broker.

    A module of `jeat_graph.live.transport.brokers` that has one, called `BROKER`, is found by the registry;
    no other file names it.

    Attributes:
        scheme: what its addresses begin with.
        title: its name, for the docs.
        port: at which it listens, if the address names none;
        secure_port: the same of encrypted connections (`SCHEME+tls://`).
        wrong_topic: says what is wrong with a topic that is to be read, wild cards allowed; empty if nothing.
        covers: whether a topic without wild cards is one of those that a subscription, the first, stands for.
        open_source: opens a source; raises `JeatGraphError` where nobody answers.
        open_sink: opens a sink, likewise.
        has_wild_cards: whether a topic stands for more than one.
        allows_name: whether a stream, a consumer, a client or a group may be called so.
        source_options: options of a source's address,
        sink_options: and of a sink's.
        secure_aliases: other schemes of encrypted connections, as other programs write them.
        greets_first: whether an encrypted connection begins with a greeting in clear.
        client: module that needs the client's package, or None.
        extra: of `jeat_graph.data.extras`, which installs it; or None.
    """

    scheme: str
    title: str
    port: int
    secure_port: int
    wrong_topic: Callable[[str], str]
    covers: Callable[[str, str], bool]
    open_source: Callable[[Address, Overdue, Notices], Source]
    open_sink: Callable[[Address, Overdue, Notices], Sink]
    has_wild_cards: Callable[[str], bool] = lambda _: False
    allows_name: Callable[[str], bool] = any_name
    source_options: tuple[str, ...] = ()
    sink_options: tuple[str, ...] = ()
    secure_aliases: tuple[str, ...] = ()
    greets_first: bool = False
    client: str | None = None
    extra: str | None = None
