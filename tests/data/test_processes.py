"""Processes that work for another: results in order, an error ends them all, and so does the other's end."""

from __future__ import annotations

import operator
import os
import subprocess
import sys
import time

import pytest

from jeat_graph.data.processes import worker_pool

# Once the worker is there, it is given ten minutes of work.
SCRIPT = """
import os, sys, time
from jeat_graph.data.processes import worker_pool
if __name__ == "__main__":
    with worker_pool(1) as pool:
        pool.submit(os.getpid).result()
        print("at work", flush=True)
        pool.submit(time.sleep, 600.0).result()
"""


def test_results_come_in_the_order_of_the_jobs():
    with worker_pool(2) as pool:
        assert list(pool.map(operator.neg, range(20))) == [-k for k in range(20)]
        assert os.getpid() not in set(pool.map(_own_number, range(4)))


def _own_number(_: int) -> int:
    return os.getpid()


def test_after_an_error_nobody_waits_for_what_still_runs():
    def work():
        with worker_pool(2) as pool:
            pool.submit(time.sleep, 600.0)
            pool.submit(operator.truediv, 1, 0).result()

    with pytest.raises(ZeroDivisionError):
        work()


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize("end", ["kill", "terminate"])
def test_workers_end_with_the_process_that_made_them(tmp_path, end):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT, encoding="utf-8")
    process = subprocess.Popen(
        [sys.executable, script], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "at work\n"
    getattr(process, end)()
    # The worker has the same output: it is at its end once nobody can write to it any more.
    assert process.stdout.read() == ""
    process.stdout.close()
    process.wait()
