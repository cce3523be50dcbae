"""Runs the jobs of a benchmark in several processes; the result does not depend on how many."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from jeat_graph.data.processes import worker_pool

_Job = TypeVar("_Job")
_Result = TypeVar("_Result")


def in_processes(
    function: Callable[[_Job], _Result], jobs: Sequence[_Job], workers: int | None, label: str
) -> list[_Result]:
    """Apply a function to jobs in several processes, with a progress bar; results in the order of the jobs.

    Args:
        function: at top level of a module, so that it can be sent.
        jobs: its arguments.
        workers: processes; by default as many as there are processors.
        label: of the progress bar.
    """
    from tqdm import tqdm

    count = min(workers or os.cpu_count() or 1, max(len(jobs), 1))
    bar: dict[str, Any] = {"total": len(jobs), "desc": label, "disable": None, "file": sys.stderr}
    if count == 1:
        return [function(job) for job in tqdm(jobs, **bar)]
    with worker_pool(count) as pool:
        return list(tqdm(pool.map(function, jobs), **bar))
