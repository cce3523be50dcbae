"""What processes of the tests begin with that need not begin from nothing: all that `track` needs is loaded.

Python and what it imports take one to two seconds of each process that is started as a user
starts it. A fork server loads them once, and the processes that it forks are at work at once. What is about
the start itself is tested with processes that start as a user's do.
"""

from __future__ import annotations

import contextlib
import io
import os
import runpy
import sys
import tempfile
from pathlib import Path

from jeat_graph.cli.main import main

ROWS = "".join(
    f"{k * 0.05:.2f},{s},{100 + 2 * k},200,40,30,0.95\n" for k in range(30) for s in ("evt", "rgb")
)


def load() -> None:
    """Track something, which loads what tracking, smoothing and writing load."""
    said = io.StringIO()
    streams = contextlib.redirect_stdout(said), contextlib.redirect_stderr(said)
    with tempfile.TemporaryDirectory() as folder, streams[0], streams[1]:
        rows = Path(folder) / "d.csv"
        rows.write_text("t,sensor,left,top,width,height,score\n" + ROWS)
        main(["track", str(rows), "--out", f"{folder}/run", "--image", "1280x720"])


def run_command(arguments: list[str], environment: dict[str, str], pipes: list) -> None:
    """Run the command as a process of its own would; `pipes` become its stdin, stdout and stderr.

    `benchmarks` stands for `python -m benchmarks`.
    """
    for number, pipe in enumerate(pipes):
        given = pipe.detach()
        os.dup2(given, number)
        os.close(given)
    os.environ.clear()
    os.environ.update(environment)
    sys.stdin = open(0, encoding="utf-8")  # noqa: SIM115
    sys.stdout = open(1, "w", encoding="utf-8")  # noqa: SIM115
    sys.stderr = open(2, "w", encoding="utf-8", buffering=1)  # noqa: SIM115
    program, given = main, arguments
    if arguments[:1] == ["benchmarks"]:
        from benchmarks.__main__ import main as program

        given = arguments[1:]
    sys.argv = ["jeat-graph", *given]
    for folder in environment.get("PYTHONPATH", "").split(os.pathsep):
        if folder and (Path(folder) / "sitecustomize.py").exists():
            runpy.run_path(str(Path(folder) / "sitecustomize.py"))
    sys.exit(program(given))


if os.environ.get("JEAT_GRAPH_LOAD"):
    load()
