"""Writing to pipes without waiting for good: for a reader that does not come, or does not read on.

An ordinary `open` of a named pipe waits until somebody reads it, and an ordinary `write` until he has read
what was written before; a signal ends neither. So pipes are written in parts that fit, and in between it is
asked whether to go on.
"""

from __future__ import annotations

import errno
import os
import select
import stat
import time
import warnings
from collections.abc import Callable
from pathlib import Path

from jeat_graph.data.errors import InputWarning

#: A pipe that is ready takes so many bytes at once (POSIX: `PIPE_BUF` is at least 512).
_PART = getattr(select, "PIPE_BUF", 512)
#: Between looks at whether to go on (s).
_SLICE_S = 0.1
#: So much is kept for a reader who has not come yet (bytes).
MOST_KEPT = 1 << 24
#: In the end a reader who has not come yet is waited for so long (s).
_LAST_WAIT_S = 5.0


def never() -> bool:
    """Go on for as long as it takes."""
    return False


def is_pipe(path: str | Path) -> bool:
    """Whether a path names a pipe; a missing one does not."""
    try:
        return os.name != "nt" and stat.S_ISFIFO(os.stat(path).st_mode)
    except OSError:
        return False


def write_to_pipe(handle: int, data: bytes, over: Callable[[], bool]) -> int:
    """Write to an open pipe, part by part.

    Args:
        handle: its number.
        data: what to write.
        over: tells whether not to wait any longer.

    Returns:
        How many bytes were written: all, unless `over` said so.

    Raises:
        BrokenPipeError: its reader has gone.
    """
    done = 0
    while done < len(data):
        if not select.select([], [handle], [], _SLICE_S)[1]:
            if over():
                break
            continue
        done += os.write(handle, data[done : done + _PART])
    return done


class PipeWriter:
    """Writes to a named pipe, whether or not somebody reads it by now.

    What is written before a reader comes is kept for him, up to `most` bytes; beyond that the oldest lines
    are left out, with a warning. A reader who is there and slow is waited for. One who goes may be followed
    by another, who gets what is written from then on.

    Args:
        path: of the pipe.
        over: tells whether the program is to end, so that nobody is waited for any longer.
        most: so much is kept (bytes).
    """

    def __init__(self, path: str | Path, over: Callable[[], bool] = never, most: int = MOST_KEPT) -> None:
        self._path, self._over, self._most = Path(path), over, most
        self._kept = bytearray()
        self._handle: int | None = None
        self._warned = self._full = False
        self.write(b"")

    def write(self, data: bytes) -> None:
        """Add whole lines."""
        self._kept += data
        if not self._open():
            if not self._warned:
                self._warned = True
                self._warn("nobody reads it yet; what is written is kept until somebody does")
            self._leave_out()
            return
        self._give()

    def close(self) -> None:
        """Give out what is left, to a reader who comes soon; what nobody takes is lost, with a warning."""
        try:
            if self._kept and not self._give_last():
                self._warn(f"nobody has read the last {len(self._kept)} bytes: they are lost")
        finally:
            if self._handle is not None:
                os.close(self._handle)
                self._handle = None

    def _give_last(self) -> bool:
        end = time.monotonic() + _LAST_WAIT_S
        while not self._open():
            if self._over() or time.monotonic() > end:
                return False
            time.sleep(_SLICE_S)
        self._give()
        return not self._kept

    def _open(self) -> bool:
        """Whether somebody reads."""
        if self._handle is None:
            try:
                self._handle = os.open(self._path, os.O_WRONLY | os.O_NONBLOCK)
            except OSError as error:
                if error.errno != errno.ENXIO:
                    raise
        return self._handle is not None

    def _give(self) -> None:
        assert self._handle is not None
        try:
            done = write_to_pipe(self._handle, bytes(self._kept), self._over)
        except BrokenPipeError:
            # What the reader had been given he had; the next one begins with what comes now.
            os.close(self._handle)
            self._handle = None
            self._kept.clear()
            self._warned = True
            self._warn("its reader has gone; what is written from now on is kept for another")
            return
        del self._kept[:done]

    def _leave_out(self) -> None:
        excess = len(self._kept) - self._most
        if excess <= 0:
            return
        del self._kept[: self._kept.find(b"\n", excess - 1) + 1 or len(self._kept)]
        if not self._full:
            self._full = True
            self._warn(f"nobody reads it: of what is kept the oldest lines, beyond {self._most} bytes, go")

    def _warn(self, text: str) -> None:
        warnings.warn(f"{self._path}: {text}", InputWarning, stacklevel=3)
