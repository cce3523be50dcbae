"""Processes that work for this one: begun anew, never outliving it, and not waited for after an error."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any


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
    pool = ProcessPoolExecutor(workers, context, begin, given)
    try:
        yield pool
        pool.shutdown()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in set(active_children()) - before:
            child.terminate()
            child.join()
