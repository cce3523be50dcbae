"""Lets the detectors of two cameras work at once: each stream of scans is made by a thread of its own.

What takes long in a detector (compiled loops, OpenCV, a network's engine) lets other threads run, so two
streams take two cores. A thread works at most a few scans ahead, so memory does not grow with the files; the
scans come in the order and with the values that they have without it.
"""

from __future__ import annotations

import contextvars
import queue
import threading
from collections.abc import Generator, Iterator

from jeat_graph.data.detections import Scan

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


def ahead(scans: Iterator[Scan]) -> Generator[Scan, None, None]:
    """Yield scans that a thread makes; whoever stops asking stops it, too.

    Args:
        scans: made in the thread, and closed there.

    Raises:
        Exception: whatever `scans` raises, at the same place.
    """
    ready: queue.Queue[Scan | _End] = queue.Queue(_MOST_AHEAD)
    stopped = threading.Event()

    def work() -> None:
        end = _End()
        try:
            for scan in scans:
                ready.put(scan)
                if stopped.is_set():
                    return
        except BaseException as error:
            end = _End(error)
        finally:
            close = getattr(scans, "close", None)  # a generator's: what it has open is closed here
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
