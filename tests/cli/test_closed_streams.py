"""Standard streams that were closed before the program began: one line, exit code 2."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(os.name == "nt", reason="the shell is POSIX's")


@pytest.mark.parametrize(("closed", "name"), [("<&-", "input"), (">&-", "output")])
def test_what_is_closed_is_said_when_it_is_used(closed, name):
    command = f"{sys.executable} -m jeat_graph {'stream' if name == 'input' else 'detectors'} {closed}"
    done = subprocess.run(command, shell=True, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.endswith(f": standard {name} is closed\n")
    assert done.stderr.count("\n") == 1
