"""Progress of long work: loops report it, whoever shows it receives it, and nothing in between needs to know.

A loop over pieces of about equal work says `for piece in with_progress(pieces)`. Who wants to know says
`with progress_to(report)` around the work; without that, `with_progress` only passes the pieces on. Of loops
within loops the inner one reports a share of the outer one's piece.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple, Protocol, TypeVar

T = TypeVar("T")
_TICK_S = 0.5


class Bar(Protocol):
    """What is needed of a progress bar."""

    disable: bool | None

    def refresh(self) -> object:
        """Draw it again."""


def write_line(text: str) -> None:
    """Write a line on stderr; a progress bar that stands there goes out of its way."""
    tqdm = sys.modules.get("tqdm")
    if tqdm is None:  # no bar was ever drawn
        print(text, file=sys.stderr, flush=True)
    else:
        tqdm.tqdm.write(text, file=sys.stderr)


@contextmanager
def refreshing(bar: Bar) -> Iterator[None]:
    """Draw a bar again and again, so that its clock goes on where the work reports nothing (compiling)."""
    if bar.disable:
        yield
        return
    over = threading.Event()

    def tick() -> None:
        while not over.wait(_TICK_S):
            bar.refresh()

    thread = threading.Thread(target=tick, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


class _Listener:
    """Receives reports of progress, as long as it waits for them.

    Args:
        report: is called with the share that is done (0 to 1).
    """

    def __init__(self, report: Callable[[float], object]) -> None:
        self.report = report
        self.waits = True


class _Span(NamedTuple):
    """What the present piece is of the whole: its begin and end, as shares."""

    listener: _Listener
    begin: float
    end: float

    def part(self, begin: float, end: float) -> _Span:
        """Return a part of it, by shares of its own."""
        width = self.end - self.begin
        return _Span(self.listener, self.begin + begin * width, self.begin + end * width)

    def enter(self) -> None:
        """Make it the present piece, if its listener still waits: a loop may end later than that."""
        if self.listener.waits:
            _span.set(self)

    def tell(self, share: float) -> None:
        """Tell how much of the whole is done."""
        if self.listener.waits:
            self.listener.report(share)


_span: ContextVar[_Span | None] = ContextVar("span", default=None)


@contextmanager
def progress_to(report: Callable[[float], object]) -> Iterator[None]:
    """Let `report` be called with the share that is done (0 to 1), as the work in the block goes on.

    Only work in the same thread is reported.
    """
    listener = _Listener(report)
    token = _span.set(_Span(listener, 0.0, 1.0))
    try:
        yield
    finally:
        listener.waits = False
        _span.reset(token)


def with_progress(pieces: Iterable[T], count: int | None = None) -> Iterator[T]:
    """Pass pieces of work on, and report how many are done.

    Args:
        pieces: of about equal work.
        count: how many there are; must be given where they have no length.
    """
    span = _span.get()
    number = count if count is not None else len(pieces) if isinstance(pieces, Collection) else 0
    if span is None or not span.listener.waits or not number:
        yield from pieces
        return
    try:
        for k, piece in enumerate(pieces):
            part = span.part(min(k, number - 1) / number, min(k + 1, number) / number)
            span.tell(part.begin)
            part.enter()
            yield piece
    finally:
        span.enter()
    span.tell(span.end)


@contextmanager
def progress_span(begin: float, end: float) -> Iterator[None]:
    """Let the work in the block be a part of the present piece, say its first third.

    Args:
        begin: share of the piece that is done before.
        end: share that is done after it.
    """
    span = _span.get()
    if span is None or not span.listener.waits:
        yield
        return
    mine = span.part(begin, end)
    span.tell(mine.begin)
    mine.enter()
    try:
        yield
    finally:
        span.enter()
    span.tell(mine.end)


def pieces_in_span(begin: float, end: float, pieces: Iterable[T]) -> Iterator[T]:
    """Pass on what is made while it is asked for; making it is a part of the present piece (`progress_span`).

    Args:
        begin: share of the piece that is done before.
        end: share that is done after it.
        pieces: that are made when they are asked for.
    """
    with progress_span(begin, end):
        yield from pieces
