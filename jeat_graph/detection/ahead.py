"""Lets the detectors of two cameras work at once, and files be read meanwhile: each by a thread of its own.

What takes long (compiled loops, OpenCV, a network's engine, unpacking) lets other threads run, so two
streams take two cores. A thread works at most a few items ahead, so memory does not grow with the files; they
come in the order and with the values that they have without it.
"""

from __future__ import annotations

import contextvars
import queue
import threading
from collections.abc import Generator, Iterator
from typing import TypeVar

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


def ahead(items: Iterator[_Item], most: int = _MOST_AHEAD) -> Generator[_Item, None, None]:
    """Yield what a thread makes; whoever stops asking stops it, too.

    Args:
        items: made in the thread, and closed there.
        most: how many it may be ahead.

    Raises:
        Exception: whatever `items` raises, at the same place.
    """
    ready: queue.Queue[_Item | _End] = queue.Queue(most)
    stopped = threading.Event()

    def work() -> None:
        end = _End()
        try:
            for made in items:
                ready.put(made)
                if stopped.is_set():
                    return
        except BaseException as error:
            end = _End(error)
        finally:
            close = getattr(items, "close", None)  # a generator's: what it has open is closed here
            if close is not None:
                close()
        ready.put(end)

    thread = threading.Thread(target=contextvars.copy_context().run, args=(work,), daemon=True)
    thread.start()
    try:
        while True:
            item = ready.get()
            if isinstance(item, _End):
                if item.error is not None:
                    raise item.error
                return
            yield item
    finally:
        stopped.set()
        while thread.is_alive():  # it may wait for room
            try:
                ready.get_nowait()
            except queue.Empty:
                thread.join(_POLL_S)
