"""Lets the detectors of two cameras work at once, and files be read meanwhile: each by a thread of its own.

What takes long (compiled loops, OpenCV, a network's engine, unpacking) lets other threads run, so two
streams take two cores. A thread works at most a few items ahead, so memory does not grow with the files; they
come in the order and with the values that they have without it.
"""

from __future__ import annotations

import contextvars
import queue
import threading
import weakref
from collections.abc import Iterator
from typing import Self, TypeVar

_Item = TypeVar("_Item")

#: Scans that a thread may be ahead.
_MOST_AHEAD = 16
#: How long to wait between two looks at whether a thread has ended (s).
_POLL_S = 0.01


class _End:
    """The end of a stream, or what ended it.

    Args:
        error: what went wrong; None at the end of the file.
    """

    def __init__(self, error: BaseException | None = None) -> None:
        self.error = error


class Ahead(Iterator[_Item]):
    """What a thread makes, which begins at once; whoever stops asking closes it, and stops the thread.

    Args:
        items: made in the thread, and closed there.
        most: how many it may be ahead.
    """

    def __init__(self, items: Iterator[_Item], most: int = _MOST_AHEAD) -> None:
        self._ready: queue.Queue[_Item | _End] = queue.Queue(most)
        self._stopped = threading.Event()
        run, work = contextvars.copy_context().run, (_work, items, self._ready, self._stopped)
        thread = threading.Thread(target=run, args=work, daemon=True)
        # The thread does not know of this object: it ends with it, too, if nobody closes it.
        self._end = weakref.finalize(self, _stop, thread, self._ready, self._stopped)
        self._end.atexit = False
        thread.start()

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> _Item:
        """Return the next item, when it has been made.

        Raises:
            Exception: whatever the items raise, at the same place.
        """
        if self._stopped.is_set():
            raise StopIteration
        item = self._ready.get()
        if not isinstance(item, _End):
            return item
        self.close()
        raise item.error if item.error is not None else StopIteration

    def close(self) -> None:
        """Stop the thread, and wait for its end."""
        self._end()


def _work(items: Iterator[_Item], ready: queue.Queue[_Item | _End], stopped: threading.Event) -> None:
    end = _End()
    try:
        try:
            for made in items:
                ready.put(made)
                if stopped.is_set():
                    return
        finally:
            close = getattr(items, "close", None)  # a generator's: what it has open is closed here
            if close is not None:
                close()
    except BaseException as error:
        end = _End(error)
    ready.put(end)


def _stop(thread: threading.Thread, ready: queue.Queue[_Item | _End], stopped: threading.Event) -> None:
    stopped.set()
    while thread.is_alive():  # it may wait for room
        try:
            ready.get_nowait()
        except queue.Empty:
            thread.join(_POLL_S)
