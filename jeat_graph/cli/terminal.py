"""How a command speaks to whoever started it: one line an error, on any terminal, an orderly end."""

from __future__ import annotations

import contextlib
import errno
import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from jeat_graph.data.progress import write_line

#: Signals that ask a process to end; each ends a command as Ctrl-C does, so that it can tidy up.
_ENDS = ("SIGTERM", "SIGHUP")
_AGAIN_S = 0.01
_FULL = (errno.ENOSPC, errno.EDQUOT)


class Terminated(KeyboardInterrupt):
    """The process was asked to end.

    Args:
        number: of the signal.
    """

    def __init__(self, number: int) -> None:
        self.number = number
        super().__init__()


def one_line(text: object) -> str:
    """Return a text as one line that no terminal obeys: what cannot be printed is escaped."""
    words = " ".join(str(text).split())
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in words)


def describe(error: BaseException) -> str:
    """Say in one line what went wrong, for errors that are the input's or the machine's."""
    if isinstance(error, MemoryError):
        return one_line(f"not enough memory: {error}" if str(error) else "not enough memory")
    if isinstance(error, OSError) and error.errno in _FULL:
        place = f", writing {error.filename}" if error.filename else ""
        return one_line(f"the disk is full{place}; nothing unfinished was left under its final name")
    return one_line(error)


def say(command: str, text: object) -> None:
    """Tell on stderr, in one line with the command's name; a progress bar that stands there moves."""
    write_line(f"jeat-graph {command}: {one_line(text)}")


def warn(command: str, text: object) -> None:
    """Tell as `say` does of what may not be as it was meant."""
    say(command, f"warning: {text}")


def write_anything() -> None:
    """Let stdout and stderr take every text: what their encoding lacks is escaped instead of an error."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, ValueError, OSError):
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]


@contextmanager
def in_good_order(command: str) -> Iterator[None]:
    """Run a command so that a signal to end lets it tidy up, and each warning is one line with its name.

    Raises:
        Terminated: within the block, where a signal came.
    """
    came: list[int] = []

    def on_signal(number: int, _: FrameType | None) -> None:
        # A second one must not interrupt the tidying up.
        signal.signal(number, signal.SIG_IGN)
        came.append(number)
        raise Terminated(number)

    def on_unraisable(unraisable: Any) -> None:
        # It came while Python ran a callback, from which no exception gets out: once more, when that is over.
        if isinstance(unraisable.exc_value, Terminated):
            signal.signal(came[0], on_signal)
            again = threading.Timer(_AGAIN_S, os.kill, (os.getpid(), came[0]))
            again.daemon = True
            again.start()
        else:
            before(unraisable)

    def show(message: Any, *_: Any, **__: Any) -> None:
        warn(command, message)

    with warnings.catch_warnings(), contextlib.ExitStack() as stack:
        warnings.showwarning = show
        for name in _ENDS:
            number = getattr(signal, name, None)
            # What somebody has set already (`nohup`, a server around us) stays.
            if number is not None and signal.getsignal(number) == signal.SIG_DFL:
                with contextlib.suppress(ValueError):  # only the main thread may set handlers
                    signal.signal(number, on_signal)
                    stack.callback(signal.signal, number, signal.SIG_DFL)
        before, sys.unraisablehook = sys.unraisablehook, on_unraisable
        stack.callback(setattr, sys, "unraisablehook", before)
        try:
            yield
        except Exception as error:
            # A library that was interrupted may answer with an error of its own: an import, by half a module.
            if came:
                raise Terminated(came[0]) from error
            raise
