"""One thread at a time in a tracker: threads that share one wait for each other, and copies share nothing."""

from __future__ import annotations

import copy
import functools
import os
import threading
from collections.abc import Callable
from typing import Any, Self, TypeVar

from jeat_graph.data.errors import JeatGraphError

Kind = TypeVar("Kind", bound=type)
#: Between two looks at whether the process is another one (s).
_BETWEEN_S = 0.2
#: Of this process; asking the system each time a lock is taken takes longer than the lock.
_process_id = os.getpid()


def _forked() -> None:
    global _process_id
    _process_id = os.getpid()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forked)


class ThreadLock:
    """A lock that its thread may take again, and that a forked process does not wait for in vain."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._process = 0

    def acquire(self) -> None:
        """Wait for the other threads.

        Raises:
            JeatGraphError: another thread had it when this process was forked, and never gives it back.
        """
        if not self._lock.acquire(blocking=False):
            while not self._lock.acquire(timeout=_BETWEEN_S):
                if self._process != _process_id:
                    raise JeatGraphError(
                        "this process was forked while another thread used the tracker: fork between its "
                        "steps, or make a tracker in the new process (Tracker.load)"
                    )
        self._process = _process_id

    def release(self) -> None:
        """Let the next thread have it."""
        self._lock.release()

    def __enter__(self) -> None:
        """Wait for the other threads, as `acquire`."""
        self.acquire()

    def __exit__(self, *error: object) -> None:
        self.release()

    def __deepcopy__(self, memo: dict[int, Any]) -> ThreadLock:
        """Return a lock of its own."""
        return ThreadLock()


class OneAtATime:
    """An object with a lock; `one_at_a_time` names the methods that take it.

    `copy.copy` and `copy.deepcopy` both give an object that shares nothing with this one.
    """

    _lock: ThreadLock

    def __new__(cls, *arguments: Any, **settings: Any) -> Self:
        """Return an object with a lock."""
        made = super().__new__(cls)
        made._lock = ThreadLock()
        return made

    def __copy__(self) -> Self:
        """Return what `copy.deepcopy` does: what two objects share, both would change."""
        return copy.deepcopy(self)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Return an object of its own in the same state."""
        made = object.__new__(type(self))
        memo[id(self)] = made
        with self._lock:
            made.__dict__.update(copy.deepcopy(self.__dict__, memo))
        return made


def one_at_a_time(names: str) -> Callable[[Kind], Kind]:
    """Have methods of a class run in one thread at a time; `names` are theirs, with blanks between."""

    def locked(method: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(method)
        def call(self: OneAtATime, *arguments: Any, **settings: Any) -> Any:
            lock = self._lock
            lock.acquire()
            try:
                return method(self, *arguments, **settings)
            finally:
                lock.release()

        return call

    def decorate(kind: Kind) -> Kind:
        for name in names.split():
            setattr(kind, name, locked(getattr(kind, name)))
        return kind

    return decorate
