"""A thread that reads a camera, mends its connection, and keeps the newest of what nobody has taken yet."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, Self, TypeVar

from jeat_graph.data.errors import LostError
from jeat_graph.io.capture.back_off import BackOff

Item = TypeVar("Item")
_Given = TypeVar("_Given", covariant=True)

#: So many items may wait for whoever takes them; when one more comes, the oldest is dropped.
MOST_WAITING = 2
#: Between looks at whether the thread is to end (s).
_SLICE_S = 0.1
#: A thread that hangs in a library is not waited for longer than this (s).
_LEAVE_S = 2.0


class Capture(Protocol[_Given]):
    """One connection to a camera, used by one thread."""

    def read(self) -> _Given | None:
        """Wait, a second at most, for what comes next; None if nothing has come that is to be taken.

        Raises:
            LostError: the connection has broken off.
        """

    def close(self) -> None:
        """Let go of the camera."""


@dataclass
class LiveStatus:
    """How a camera is doing.

    Attributes:
        name: address of the camera, as it may be shown.
        sensor: name of its sensor, where it has one: two channels of a recorder may be shown as one address.
        connected: whether it is connected now.
        ever: whether it has been.
        taken: items that have come.
        dropped: items that were dropped because nobody took them in time.
        reconnects: how often a connection was mended.
        last: when the last item came (s, of `time.monotonic`), or when reading began.
        trouble: why it is not connected, or empty.
    """

    name: str
    sensor: str = ""
    connected: bool = False
    ever: bool = False
    taken: int = 0
    dropped: int = 0
    reconnects: int = 0
    last: float = 0.0
    trouble: str = ""

    @property
    def shown(self) -> str:
        """Its sensor, if it has a name, and its address."""
        return f"{self.sensor} ({self.name})" if self.sensor else self.name


class LiveReader(Generic[Item]):
    """Reads a camera until it is closed; a context manager.

    The connection is made, and made again when it breaks off, for as long as it takes, with growing pauses;
    each of this is reported in a line. Who takes the items more slowly than they come gets the newest ones.

    Args:
        name: address of the camera, as it may be shown.
        connect: makes a connection.
        tell: takes each line for the user; called by the reading thread.
        waiting: so many items may wait.
        patience_s: a camera that is connected and gives nothing for so long (s) is connected again.

    Attributes:
        status: how the camera is doing; only to read.
    """

    def __init__(
        self,
        name: str,
        connect: Callable[[], Capture[Item]],
        tell: Callable[[str], object],
        waiting: int = MOST_WAITING,
        patience_s: float = 10.0,
    ) -> None:
        self.status = LiveStatus(name, last=time.monotonic())
        self._connect, self._tell, self._patience_s = connect, tell, patience_s
        self._items: deque[Item] = deque()
        self._most = waiting
        self._change = threading.Condition()
        self._closed = threading.Event()
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name=f"read {name}", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def take(self, timeout_s: float) -> Item | None:
        """Wait for the oldest item that waits; None if none came in that time.

        Raises:
            JeatGraphError: what no new attempt would mend, such as a package that is missing.
        """
        with self._change:
            self._change.wait_for(lambda: bool(self._items) or self._error is not None, timeout_s)
            if self._items:
                return self._items.popleft()
            if self._error is not None:
                raise self._error
            return None

    def close(self) -> None:
        """End the thread; one that hangs in a library is left behind, and ends with the process."""
        self._closed.set()
        if self._thread.is_alive():
            self._thread.join(_LEAVE_S)

    def _run(self) -> None:
        back_off = BackOff()
        try:
            while not self._closed.is_set():
                try:
                    self._read_one_connection(back_off)
                except LostError as error:
                    self._lost(error, back_off)
        except BaseException as error:
            with self._change:
                self.status.connected = False
                self._error = error
                self._change.notify_all()

    def _read_one_connection(self, back_off: BackOff) -> None:
        capture = self._connect()
        status = self.status
        try:
            since = time.monotonic()
            while not self._closed.is_set():
                item = capture.read()
                now = time.monotonic()
                if item is None:
                    if now - since > self._patience_s:
                        raise LostError(f"nothing has come for {self._patience_s:g} s")
                    continue
                since = now
                if not status.connected:
                    self._found(back_off)
                self._put(item, now)
        finally:
            capture.close()

    def _found(self, back_off: BackOff) -> None:
        status = self.status
        if status.ever:
            status.reconnects += 1
            lost_s = time.monotonic() - status.last
            self._tell(f"{status.shown}: connected again, after {lost_s:.1f} s")
        else:
            self._tell(f"{status.shown}: connected")
        status.connected, status.ever, status.trouble = True, True, ""
        back_off.succeeded()

    def _put(self, item: Item, now: float) -> None:
        with self._change:
            while len(self._items) >= self._most:
                self._items.popleft()
                self.status.dropped += 1
            self._items.append(item)
            self.status.taken += 1
            self.status.last = now
            self._change.notify_all()

    def _lost(self, error: LostError, back_off: BackOff) -> None:
        status = self.status
        status.connected, status.trouble = False, str(error)
        pause_s = back_off.failed()
        self._tell(f"warning: {status.shown}: {error}; trying again in {pause_s:g} s")
        end = time.monotonic() + pause_s
        while time.monotonic() < end and not self._closed.wait(_SLICE_S):
            pass
