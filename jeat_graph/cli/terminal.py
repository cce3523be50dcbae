"""How a command speaks to whoever started it: one line an error, on any terminal, an orderly end."""

from __future__ import annotations

import _thread
import contextlib
import errno
import os
import signal
import sys
import threading
import time
import traceback
import warnings
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.machinery import ExtensionFileLoader
from types import FrameType
from typing import Any, NoReturn

from jeat_graph.data.progress import write_line
from jeat_graph.data.secrets import without_logins

#: Signals that ask a process to end, the first by Ctrl-C; each lets a command tidy up.
_ENDS = ("SIGINT", "SIGTERM", "SIGHUP")
#: Handlers that nobody has set: what Python begins with.
_UNSET = (signal.SIG_DFL, signal.default_int_handler)
_LOADS_COMPILED = (ExtensionFileLoader.create_module.__code__, ExtensionFileLoader.exec_module.__code__)
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
    """Return a text as one line that no terminal obeys and that shows no password.

    What cannot be printed is escaped; users and passwords in URLs are struck out.
    """
    words = " ".join(without_logins(str(text)).split())
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in words)


def describe(error: BaseException) -> str:
    """Say in one line what went wrong, for errors that are the input's or the machine's."""
    if isinstance(error, MemoryError):
        return one_line(f"not enough memory: {error}" if str(error) else "not enough memory")
    if isinstance(error, OSError) and error.errno == errno.EBADF and not error.filename:
        return one_line(error.strerror)
    if isinstance(error, OSError) and error.errno in _FULL:
        place = f", writing {error.filename}" if error.filename else ""
        return one_line(
            f"the disk is full{place}; files that are written whole are as they were, those that grow end "
            "with a whole line"
        )
    return one_line(error)


def say(command: str | None, text: object) -> None:
    """Tell on stderr, in one line with the command's name, if any; a progress bar that stands there moves."""
    write_line(f"{f'jeat-graph {command}' if command else 'jeat-graph'}: {one_line(text)}")


def warn(command: str | None, text: object) -> None:
    """Tell as `say` does of what may not be as it was meant."""
    say(command, f"warning: {text}")


class _Closed:
    """What stands for a standard stream that was closed before the program began."""

    closed = False  # to whoever asks; it fails when it is used
    encoding, errors = "utf-8", "backslashreplace"

    def __init__(self, name: str) -> None:
        self._name = name

    @property
    def buffer(self) -> NoReturn:
        """Its bytes; there are none."""
        raise OSError(errno.EBADF, f"standard {self._name} is closed")

    def write(self, _: str) -> NoReturn:
        """Write nothing, and do not say that all was well."""
        raise OSError(errno.EBADF, f"standard {self._name} is closed")

    def read(self, *_: int) -> NoReturn:
        """Read nothing."""
        raise OSError(errno.EBADF, f"standard {self._name} is closed")

    def flush(self) -> None:
        """Nothing waits."""

    def isatty(self) -> bool:
        """It is no terminal."""
        return False

    def fileno(self) -> NoReturn:
        """It has no number."""
        raise OSError(errno.EBADF, f"standard {self._name} is closed")


def stand_for_closed() -> None:
    """See that standard streams are there: a closed one fails when it is used, in one line.

    Its number is taken by the null device, so that no file that is opened later is written to in its place.
    """
    for name in ("input", "output"):
        attribute = f"std{name[:-3]}"
        if getattr(sys, attribute) is None:
            os.open(os.devnull, os.O_RDWR)
            setattr(sys, attribute, _Closed(name))
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115, for as long as the process lives


def write_anything() -> None:
    """Let stdout and stderr take every text: what their encoding lacks is escaped instead of an error."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, ValueError, OSError):
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]


class _Ending:
    """Ends what runs when a signal comes, and once more where the exception that does so got lost.

    Attributes:
        came: numbers of the signals that came.
    """

    def __init__(self) -> None:
        self.came: list[int] = []
        self._thrown: list[weakref.ref[Terminated]] = []
        self._over = False
        self._lock = threading.Lock()

    def on_signal(self, number: int, frame: FrameType | None) -> None:
        """End what runs, but no compiled library while it sets itself up: half of one crashes at exit."""
        if _loads_compiled(frame):
            self._send_again(number)
            return
        # A second one must not interrupt the tidying up.
        signal.signal(number, signal.SIG_IGN)
        self.came.append(number)
        raise self._watched(number)  # a name for it would keep it alive in this frame

    def _watched(self, number: int) -> Terminated:
        """Make the exception, and notice when nobody has it any more."""
        end = Terminated(number)
        self._thrown = [weakref.ref(end, lambda _: self._throw_again(number))]
        return end

    def _throw_again(self, number: int) -> None:
        # It came while a library ran a callback, from which no exception gets out: when that is over.
        with contextlib.suppress(ValueError, RuntimeError):  # another thread had it; Python ends
            signal.signal(number, self.on_signal)
            self._send_again(number)

    def _send_again(self, number: int) -> None:
        # Not by `threading`, which may hold a lock of its own just now.
        _thread.start_new_thread(self._send_soon, (number,))

    def _send_soon(self, number: int) -> None:
        time.sleep(_AGAIN_S)
        with self._lock:
            if self._over:
                return
            if os.name == "nt":
                _thread.interrupt_main(signal.Signals(number))  # there `os.kill` ends a process at once
            else:
                os.kill(os.getpid(), number)

    def forget(self) -> None:
        """Throw nothing any more."""
        self._thrown.clear()
        with self._lock:
            self._over = True


def _loads_compiled(frame: FrameType | None) -> bool:
    """Tell whether an import of compiled code is under way."""
    while frame is not None:
        if frame.f_code in _LOADS_COMPILED:
            return True
        frame = frame.f_back
    return False


@contextmanager
def in_good_order(command: str | None) -> Iterator[None]:
    """Run a command so that a signal to end lets it tidy up, and each warning is one line with its name.

    Args:
        command: its name, if it is known.

    Raises:
        Terminated: within the block, where a signal came.
    """
    ending = _Ending()

    def on_unraisable(unraisable: Any) -> None:
        # An end that got lost is thrown again, and what it left half made complains when it goes.
        if not ending.came:
            before(unraisable)

    def show(message: Any, *_: Any, **__: Any) -> None:
        warn(command, message)

    with warnings.catch_warnings(), contextlib.ExitStack() as stack:
        warnings.showwarning = show
        for name in _ENDS:
            number = getattr(signal, name, None)
            # What somebody has set already (`nohup`, a server around us) stays.
            if number is not None and (set_before := signal.getsignal(number)) in _UNSET:
                with contextlib.suppress(ValueError):  # only the main thread may set handlers
                    signal.signal(number, ending.on_signal)
                    stack.callback(signal.signal, number, set_before)
        before, sys.unraisablehook = sys.unraisablehook, on_unraisable
        stack.callback(setattr, sys, "unraisablehook", before)
        stack.callback(ending.forget)
        try:
            yield
        except (Exception, Terminated) as error:
            if not ending.came:
                raise
            traceback.clear_frames(error.__traceback__)  # lets go of what is half made, here
            if isinstance(error, Terminated):
                raise
            # A library that was interrupted may answer with an error of its own: an import, by half a module.
            raise Terminated(ending.came[0]) from error
