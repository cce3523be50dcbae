"""Processes that work for this one: begun anew, never outliving it, and not waited for after an error."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager


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


@contextmanager
def worker_pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Give a pool of processes; after an error or an interrupt what still runs in it is ended.

    Args:
        workers: how many processes.
    """
    from multiprocessing import active_children, get_context

    before = set(active_children())
    context = get_context("spawn")  # fork would copy the threads' locks of other libraries
    pool = ProcessPoolExecutor(workers, context, end_with_parent)
    try:
        yield pool
        pool.shutdown()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in set(active_children()) - before:
            child.terminate()
            child.join()
