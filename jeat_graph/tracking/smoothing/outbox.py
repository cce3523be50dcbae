"""Sending to another process without waiting for it."""

from __future__ import annotations

import queue
from multiprocessing.connection import Connection
from threading import Thread
from typing import Any


class Outbox:
    """Sends objects through a connection, one after the other, from a thread of its own.

    The thread dies with the process and never keeps it from ending. It ends when the connection breaks, so
    that closing the other end, or the death of the process there, is the end of both.

    Args:
        connection: the end that is written to; the outbox closes it.
        most: how many objects may wait.
    """

    def __init__(self, connection: Connection, most: int) -> None:
        self._waiting: queue.Queue[Any] = queue.Queue(most)
        self._thread = Thread(target=_send_all, args=(self._waiting, connection), daemon=True)
        self._thread.start()

    def put(self, content: Any, timeout_s: float) -> None:
        """Hand over an object to be sent.

        Args:
            content: anything that can be pickled; it must not change any more.
            timeout_s: how long to wait for room (s).

        Raises:
            queue.Full: there was no room in that time.
            BrokenPipeError: nobody is there any more to receive it.
        """
        if not self._thread.is_alive():
            raise BrokenPipeError
        self._waiting.put((content,), timeout=timeout_s)

    def close(self) -> None:
        """Send what waits, if somebody is there to receive it, and close the connection."""
        while self._thread.is_alive():
            try:
                self._waiting.put(None, timeout=0.1)
                self._thread.join()
            except queue.Full:
                continue


def _send_all(waiting: queue.Queue[Any], connection: Connection) -> None:
    """Send until told to stop, or until the connection breaks."""
    with connection:
        while (parcel := waiting.get()) is not None:
            try:
                connection.send(*parcel)
            except OSError:
                return
