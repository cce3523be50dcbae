"""Makes segments in processes of their own; the result does not depend on how many there are."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jeat_graph.data.errors import JeatGraphError
from jeat_graph.data.processes import available_cores, end_with_parent, safe_start, worker_pool
from jeat_graph_sehn.simulation.dataset.disk import check_disk
from jeat_graph_sehn.simulation.dataset.protocol import Protocol
from jeat_graph_sehn.simulation.dataset.segment_writer import write_segment
from jeat_graph_sehn.simulation.segment import SegmentSource

SourceFactory = Callable[[], SegmentSource]
_POLL_S = 0.3  # between looks at how many frames are done


@dataclass
class _Worker:
    """What a process keeps from one segment to the next."""

    source: SegmentSource
    root: Path
    protocol: Protocol
    counter: Any


_worker: _Worker | None = None


def make_segments(
    factory: SourceFactory,
    root: Path,
    protocol: Protocol,
    indices: Sequence[int],
    workers: int,
    on_frames: Callable[[int], object],
) -> Generator[dict[str, Any], None, None]:
    """Make segments and yield the entry of each as it is done, in any order.

    Args:
        factory: makes the source; with several workers it must be picklable, as a `functools.partial` of a
            class is.
        root: the data set's folder.
        protocol: how to store.
        indices: which segments.
        workers: number of processes; 1 works in this one.
        on_frames: called with the number of frames done since the last call.

    Raises:
        JeatGraphError: what the source or the writer raised, or that a process has died.
    """
    if workers <= 1 or len(indices) <= 1:
        source = factory()
        for index in indices:
            yield write_segment(source, index, root, protocol, lambda: on_frames(1))
        return
    with safe_start():
        counter = multiprocessing.get_context("spawn").Value("q", 0)
    threads = max(1, available_cores() // workers)
    given = (factory, root, protocol, counter, threads)
    shown = 0
    try:
        with worker_pool(min(workers, len(indices)), _begin, given) as pool:
            pending: set[Future[dict[str, Any]]] = {pool.submit(_make, index) for index in indices}
            while pending:
                done, pending = wait(pending, _POLL_S, FIRST_COMPLETED)
                frames = int(counter.value)
                on_frames(frames - shown)
                shown = frames
                for future in done:
                    yield future.result()
    except BrokenProcessPool:
        check_disk(root)
        raise JeatGraphError(
            "a worker process died (out of memory?); what is done is kept, run again to go on"
        ) from None


def _begin(factory: SourceFactory, root: Path, protocol: Protocol, counter: Any, threads: int) -> None:
    global _worker
    import cv2
    import numba

    end_with_parent()
    cv2.setNumThreads(threads)
    numba.set_num_threads(min(threads, numba.get_num_threads()))
    _worker = _Worker(factory(), root, protocol, counter)


def _make(index: int) -> dict[str, Any]:
    assert _worker is not None
    worker = _worker

    def count() -> None:
        with worker.counter.get_lock():
            worker.counter.value += 1

    return write_segment(worker.source, index, worker.root, worker.protocol, count)
