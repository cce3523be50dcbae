"""Small recordings and a way to run commands as a user does."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from jeat_graph.cli.main import main

HEADER = "t,sensor,left,top,width,height,score\n"


@pytest.fixture(scope="session")
def recording(tmp_path_factory) -> Path:
    """A folder with `detections.csv` and `gt.csv` of a simulated second."""
    folder = tmp_path_factory.mktemp("recording")
    assert main(["simulate", "night", "--out", str(folder), "--duration", "1.2", "--seed", "5"]) == 0
    return folder


@pytest.fixture
def write(tmp_path):
    """Write detections given as lines of CSV, and return the path."""

    def to_file(*lines: str, name: str = "det.csv", header: str = HEADER) -> str:
        path = tmp_path / name
        path.write_text(header + "".join(line + "\n" for line in lines))
        return str(path)

    return to_file


@pytest.fixture
def fails(capsys):
    """Run a command that must fail with one line on stderr and nothing on stdout; return that line."""

    def run(*arguments: str) -> str:
        capsys.readouterr()
        assert main([str(a) for a in arguments]) == 2
        caught = capsys.readouterr()
        assert caught.out == ""
        assert caught.err.count("\n") == 1
        assert "Traceback" not in caught.err
        return caught.err

    return run


def as_user(*arguments: str, **options) -> subprocess.CompletedProcess[str]:
    """Run the installed command in a process of its own."""
    command = [sys.executable, "-m", "jeat_graph.cli.main", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False, **options)
