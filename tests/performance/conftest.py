"""Time and memory, measured where nothing else of ours disturbs them.

Memory is read in a process of its own, in which no other test has left anything. Parallel runs leave time
out; `make test` takes it by itself afterwards. Time is that of the processor, always compared with something
measured in the same run, and of several turns the best counts: other work on the machine only ever adds.
"""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

collect_ignore_glob = ["test_time.py"] if "PYTEST_XDIST_WORKER" in os.environ else []


@pytest.fixture
def measure():
    """A function: name of a job in `jobs.py` and its arguments -> what it found, in a process of its own."""

    def run(*arguments):
        command = [sys.executable, "-m", "tests.performance.jobs", *arguments]
        root = Path(__file__).parents[2]
        done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=root)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return run


@pytest.fixture
def least():
    """A function: actions -> least processor time (s) of each, over turns in which all have their go.

    Some turns are always taken; where what `until` claims of the times does not hold yet, more are, each a
    little later than the one before. Of a true claim a busy machine can so only delay the proof: the least
    of many turns is what the action costs where nothing disturbs it.
    """

    def run(*actions, until, turns=4, most=40):
        seconds = [[] for _ in actions]
        for action in actions:
            action()
        for turn in range(most):
            if turn >= turns:
                if until(*(min(spent) for spent in seconds)):
                    break
                time.sleep(0.05 * (turn - turns))
            for action, spent in zip(actions, seconds, strict=True):
                began = time.process_time()
                action()
                spent.append(time.process_time() - began)
        return [min(spent) for spent in seconds]

    return run
