"""Ctrl-C and its like: what waits ends soon, what is being done is done to its end."""

from __future__ import annotations

import contextlib
import math
import os
import select
import signal
import time
from collections.abc import Callable, Iterator
from types import FrameType
from typing import BinaryIO, Self

from jeat_graph.io.streams.stream_text import line_reader

#: After a signal a broker, or the rest of a line, is waited for no longer than this (s).
GRACE_S = 0.5
_PART = 2**14  # read at a time: what is taken is answered, even after a signal
_SLICE_S = 0.05


class Interrupts:
    """Ctrl-C, SIGTERM and SIGHUP end the wait for a message at once, but never a step halfway.

    Attributes:
        seen: the signal that came first, or None.
    """

    def __init__(self) -> None:
        self.seen: int | None = None
        self._since = math.inf
        self._before: dict[int, Callable[[int, FrameType | None], object] | int | None] = {}
        self._woken: int | None = None  # a pipe into which the system writes the number of each signal
        self._undo = contextlib.ExitStack()

    def __enter__(self) -> Self:
        # Only the main thread may set handlers; elsewhere interrupts stay what they are.
        with contextlib.suppress(ValueError), contextlib.ExitStack() as undo:
            # A handler alone is not enough: a signal just before a wait begins would not end it.
            woken, wakes = os.pipe()
            undo.callback(os.close, woken)
            undo.callback(os.close, wakes)
            os.set_blocking(woken, False)
            os.set_blocking(wakes, False)
            undo.callback(signal.set_wakeup_fd, signal.set_wakeup_fd(wakes, warn_on_full_buffer=False))
            self._woken = woken
            for name in ("SIGINT", "SIGTERM", "SIGHUP"):
                number = getattr(signal, name, None)
                # What `nohup` has set stays.
                if number is None or (name == "SIGHUP" and signal.getsignal(number) == signal.SIG_IGN):
                    continue
                self._before[number] = signal.signal(number, self._on_signal)
                undo.callback(signal.signal, number, self._before[number])
            self._undo = undo.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        self._undo.close()
        self._woken = None

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        if self.seen is None:
            self._since, self.seen = time.monotonic(), number

    def overdue(self) -> bool:
        """Tell whether a signal came so long ago that nothing more is to be waited for."""
        return time.monotonic() > self._since + GRACE_S

    def wait(self, number: int) -> bool:
        """Wait until something can be read from a file, by its number; False if an interrupt comes first."""
        while self.seen is None:
            ends = [number] if self._woken is None else [number, self._woken]
            ready, _, _ = select.select(ends, [], [])
            if self._woken in ready:
                # The handler may not have run yet.
                for came in os.read(self._woken, _PART):
                    if came in self._before:
                        self._on_signal(came, None)
            elif ready:
                return True
        return False

    def lines(self, stream: BinaryIO) -> Iterator[bytes]:
        """Yield lines until the input ends or an interrupt comes.

        What has been taken from the input is given out, all of it: whoever reads on there misses no line.

        Args:
            stream: a file, a pipe or a terminal of which nothing has been read, or an object in memory.
        """
        number = _number_of(stream)
        if number is not None:
            read = line_reader(_Lines(number, self).readline)
            while line := read():
                yield line
            return
        read = line_reader(stream.readline)
        while self.seen is None and (line := read()):
            yield line


class _Lines:
    """Lines of a file by its number, until an interrupt comes."""

    def __init__(self, number: int, interrupts: Interrupts) -> None:
        self._number, self._interrupts = number, interrupts
        self._held = bytearray()
        self._ended = False

    def readline(self, most: int) -> bytes:
        """Read to the end of the line, or `most` bytes of it; nothing at the end, or after an interrupt."""
        searched = 0
        while True:
            end = self._held.find(b"\n", searched) + 1
            searched = len(self._held)
            if end or searched >= most:
                return self._take(min(end or most, most))
            if self._ended:
                # A writer that the same signal ends leaves a line half written.
                return b"" if self._interrupts.seen is not None else self._take(searched)
            part = self._more()
            if part is None:
                return b""
            self._ended = not part
            self._held += part

    def _take(self, count: int) -> bytes:
        line = bytes(self._held[:count])
        del self._held[:count]
        return line

    def _more(self) -> bytes | None:
        """What comes next, nothing at the end; None after an interrupt, unless a line has been begun."""
        while True:
            most = _PART
            if not self._interrupts.wait(self._number):
                if not self._held or self._interrupts.overdue():
                    return None
                most = 1  # the end of the line, and nothing of the next one
                if not select.select([self._number], [], [], _SLICE_S)[0]:
                    continue
            with contextlib.suppress(BlockingIOError):  # somebody else has read it
                return os.read(self._number, most)


def _number_of(stream: BinaryIO) -> int | None:
    """The number by which the system knows a stream; None where there is none that can be waited for."""
    if os.name == "nt":  # there only sockets can
        return None
    try:
        return stream.fileno()
    except (AttributeError, OSError):
        return None
