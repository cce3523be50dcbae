"""What readers found out by themselves and a user may want to know, such as which frame is the first.

A command listens while it runs and tells each note once; without a listener notes go nowhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_listener: ContextVar[Callable[[str], object] | None] = ContextVar("notes", default=None)


def note(text: str) -> None:
    """Tell the listener, if there is one.

    Args:
        text: one line.
    """
    listener = _listener.get()
    if listener is not None:
        listener(text)


@contextmanager
def listening(say: Callable[[str], object]) -> Iterator[None]:
    """Have notes reported while the `with` block runs, each once, even where a file is read several times.

    Args:
        say: called with each new note.
    """
    seen: set[str] = set()

    def once(text: str) -> None:
        if text not in seen:
            seen.add(text)
            say(text)

    token = _listener.set(once)
    try:
        yield
    finally:
        _listener.reset(token)
