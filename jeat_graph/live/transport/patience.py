"""How long an end waits for its broker: for as long as it takes, but not when the program is to end."""

from __future__ import annotations

from collections.abc import Callable

from jeat_graph.data.errors import JeatGraphError

#: Between looks at whether the program is to end (s).
SLICE_S = 0.1
#: Tells whether the program is to end and nothing more is to be waited for.
Overdue = Callable[[], bool]


class UnconfirmedError(JeatGraphError):
    """The program is to end before a broker has confirmed what was sent, which may so be lost."""


def never() -> bool:
    """Wait for as long as it takes."""
    return False


def check(overdue: Overdue, where: object) -> None:
    """Look, between two slices of a wait, whether to go on with it.

    Args:
        overdue: tells whether the program is to end.
        where: the address, for the message.

    Raises:
        UnconfirmedError: it is to end.
    """
    if overdue():
        raise UnconfirmedError(f"{where}: the broker has not confirmed all tracks")
