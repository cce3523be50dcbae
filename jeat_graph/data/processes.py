"""Processes that work for this one: started again, never outliving it, and not waited for after an error.

A new interpreter looks for modules in the current folder first, before the one that starts it can tell it
where else to look. There lie the user's data, and what came with them: a `signal.py` among them would be run.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any, TypeVar

_Result = TypeVar("_Result")


def end_with_parent() -> None:
    """Leave interrupts to the process that made this one, and end when it ends, however that happens."""
    from multiprocessing import parent_process

    parent = parent_process()
    if parent is None:
        return
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


# What Python takes as "do not look for modules in the current folder"; new interpreters inherit it.
_SAFE_PATH = "PYTHONSAFEPATH"
_starting = threading.RLock()


@contextmanager
def safe_start() -> Iterator[None]:
    """Keep interpreters that are started meanwhile from looking for modules in the current folder.

    Whatever `multiprocessing` starts belongs in here: processes, and the first lock, queue or shared value,
    with which it starts a process of its own that keeps count of them.
    """
    with _starting:
        before = os.environ.get(_SAFE_PATH)
        os.environ[_SAFE_PATH] = "1"
        try:
            yield
        finally:
            if before is None:
                os.environ.pop(_SAFE_PATH, None)
            else:
                os.environ[_SAFE_PATH] = before


class SafePool(ProcessPoolExecutor):
    """A pool of processes that are started as `safe_start` says."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        with safe_start():
            super().__init__(*arguments, **named)

    def submit(self, fn: Callable[..., _Result], /, *args: Any, **kwargs: Any) -> Future[_Result]:
        """Have a process do something; it is started here if need be."""
        with safe_start():
            return super().submit(fn, *args, **kwargs)


def available_cores() -> int:
    """Return the number of cores that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity is not None else (os.cpu_count() or 1)


@contextmanager
def worker_pool(
    workers: int, begin: Callable[..., object] = end_with_parent, given: tuple[Any, ...] = ()
) -> Iterator[ProcessPoolExecutor]:
    """Give a pool of processes; after an error or an interrupt what still runs in it is ended.

    Args:
        workers: how many processes.
        begin: what each does first; one of the caller's own says `end_with_parent` too.
        given: what `begin` is given; may hold what processes share, of the context `spawn`.
    """
    from multiprocessing import active_children, get_context

    before = set(active_children())
    context = get_context("spawn")  # fork would copy the threads' locks of other libraries
    pool = SafePool(workers, context, begin, given)
    try:
        yield pool
        pool.shutdown()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in set(active_children()) - before:
            child.terminate()
            child.join()
