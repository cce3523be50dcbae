"""Where the recordings of a batch are worked on: processes of this machine, or a Ray cluster."""

from __future__ import annotations

import contextlib
import os
import signal
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any, TypeVar

from jeat_graph.data.errors import JeatGraphError
from jeat_graph.data.extras import install
from jeat_graph.data.processes import SafePool, end_with_parent, safe_start

ENGINES = ("local", "ray")
_Job = TypeVar("_Job")
_Result = TypeVar("_Result")
#: Where the package itself lies, so that modules are looked for there already.
_PACKAGES = Path(__file__).parents[2]
_WAIT_S = 0.5  # between looks at whether an interrupt has come


class _Ended(BaseException):
    """A worker was asked to end while it worked."""


def run_local(
    work: Callable[[_Job], _Result],
    jobs: Sequence[_Job],
    lost: Callable[[_Job], _Result],
    *,
    workers: int,
    retries: int = 1,
) -> Generator[_Result, None, None]:
    """Work on jobs in processes of this machine; yield each result as it is there.

    Each worker has a pool of its own, so that one that dies takes no other job with it than its own.

    Args:
        work: the work, importable by name.
        jobs: what it is given, one after the other.
        lost: the result of a job whose worker died each time.
        workers: how many processes.
        retries: how often a job whose worker died is given to another one.
    """
    from multiprocessing import active_children, get_context

    before = set(active_children())
    context = get_context("spawn")  # fork would copy the threads' locks of other libraries

    def pool() -> ProcessPoolExecutor:
        return SafePool(1, context, end_with_parent)

    pools: dict[int, ProcessPoolExecutor] = {}
    at_work: dict[Future[_Result], tuple[int, int, int]] = {}  # job's index, tries before, the worker
    waiting = [(k, 0) for k in reversed(range(len(jobs)))]
    free = list(range(min(workers, len(jobs))))
    try:
        while waiting or at_work:
            while waiting and free:
                (index, tries), slot = waiting.pop(), free.pop()
                if slot not in pools:
                    pools[slot] = pool()
                at_work[pools[slot].submit(_in_good_order, work, jobs[index])] = (index, tries, slot)
            done, _ = wait(at_work, _WAIT_S, FIRST_COMPLETED)
            for future in done:
                index, tries, slot = at_work.pop(future)
                free.append(slot)
                try:
                    yield future.result()
                except BrokenProcessPool:
                    pools.pop(slot).shutdown(wait=False)
                    if tries < retries:
                        waiting.append((index, tries + 1))
                    else:
                        yield lost(jobs[index])
    finally:
        # After an error or an interrupt: do not wait for what runs.
        for one in pools.values():
            one.shutdown(wait=not at_work, cancel_futures=True)
        for child in set(active_children()) - before:
            child.terminate()
            child.join()


def _in_good_order(work: Callable[[_Job], _Result], job: _Job) -> _Result:
    """Work on a job; a worker that is asked to end (SIGTERM) first takes away what it has not finished."""

    def on_signal(number: int, _: object) -> None:
        signal.signal(number, signal.SIG_IGN)  # a second one must not interrupt the tidying up
        raise _Ended

    signal.signal(signal.SIGTERM, on_signal)
    try:
        return work(job)
    except _Ended:
        os._exit(128 + signal.SIGTERM)  # to the pool a death like any other
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def run_on_ray(
    work: Callable[[_Job], _Result],
    jobs: Sequence[_Job],
    lost: Callable[[_Job], _Result],
    *,
    workers: int | None = None,
    retries: int = 3,
    address: str | None = None,
) -> Generator[_Result, None, None]:
    """Work on jobs as tasks of a Ray cluster; yield each result as it is there.

    A task whose worker or node dies is run again by Ray. Every node must see the files under the same paths.

    Args:
        work: the work.
        jobs: what it is given.
        lost: the result of a job whose worker died each time.
        workers: processes of a cluster that is started here for the purpose; None for one a core.
        retries: how often Ray runs a task again whose worker died.
        address: of a running cluster (`auto`, `ray://host:10001`); None starts one on this machine.

    Raises:
        JeatGraphError: Ray is not installed, or the cluster cannot be reached.
    """
    try:
        import ray
        from ray.exceptions import RayError
    except ImportError:
        raise JeatGraphError(f"--engine ray needs Ray: {install('ray')}") from None
    options: dict[str, Any] = {"log_to_driver": False, "logging_level": "error"}
    if address is None:
        options |= {"num_cpus": workers, "include_dashboard": False}
    began = not ray.is_initialized()
    if began:
        try:
            # Ray has its workers look for modules in the folder that it is started in, where users' data lie.
            with safe_start(), contextlib.chdir(_PACKAGES):
                ray.init(address=address, **options)
        except (ConnectionError, OSError, ValueError) as error:
            raise JeatGraphError(f"no Ray cluster at {address}: {error}") from None
    try:
        # Only a worker's death is tried again: an error of the work itself would come again.
        task = ray.remote(max_retries=retries, retry_exceptions=False, num_cpus=1)(work)
        at_work = {task.remote(job): job for job in jobs}
        while at_work:
            done, _ = ray.wait(list(at_work), num_returns=1, timeout=_WAIT_S)
            for reference in done:
                job = at_work.pop(reference)
                try:
                    yield ray.get(reference)
                except RayError:
                    yield lost(job)
    finally:
        if began:
            ray.shutdown()
