"""What all tests share: those of jeat-graph, of the benchmarks, and of jeat-graph-sehn."""

from __future__ import annotations

import atexit
import gc
import multiprocessing
import os
import shutil
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import settings

_TESTS = Path(__file__).parent / "tests"
# The tests share the cores: the threads of one's linear algebra would only wait for those of the others.
# This is before anything that loads it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
if "JEAT_GRAPH_NETWORKS" not in os.environ:
    # No network of whoever runs the tests, and no choice of a detector that a test keeps for a camera.
    os.environ["JEAT_GRAPH_NETWORKS"] = tempfile.mkdtemp(prefix="jeat-graph-networks-")
    atexit.register(shutil.rmtree, os.environ["JEAT_GRAPH_NETWORKS"], ignore_errors=True)

# Examples follow from the test and from the constants in the modules that are loaded, not from a clock:
# what a test counts over its examples still differs a little with what ran before it, and its bound must
# allow for that.
_FULL = os.environ.get("JEAT_GRAPH_FULL", "") not in ("", "0")
settings.register_profile("jeat-graph", deadline=None, derandomize=True, max_examples=200 if _FULL else 25)
settings.load_profile("jeat-graph")

# What is imported and collected stays to the end: the collector need not look through half a million objects
# again and again, neither while they are made nor after.
gc.disable()


def pytest_collection_finish() -> None:
    """From here on garbage is collected, less often than else: looking for it is a twentieth of all time."""
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
    gc.enable()


@pytest.fixture(scope="session")
def full() -> bool:
    """Whether the long form of the tests is asked for."""
    return _FULL


@pytest.fixture(scope="session")
def dying():
    """Make the environment of processes that end at a chosen change to files (`dying/sitecustomize.py`)."""

    def environment(below: Path, at: int = 0, by: int = 9, **more: object) -> dict[str, str]:
        """Where changes count, the number of the fatal one, and the signal; `once`, `log`, `name`."""
        paths = [str(_TESTS / "dying"), os.environ.get("PYTHONPATH", "")]
        fate = {"below": below, "at": at, "by": int(by), **more}
        return {
            **os.environ,
            "PYTHONPATH": os.pathsep.join(filter(None, paths)),
            **{f"DYING_{key.upper()}": str(value) for key, value in fate.items()},
        }

    return environment


@pytest.fixture(scope="session")
def loaded():
    """The context of processes that begin with all loaded (`loaded/loaded_process.py`)."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        pytest.skip("processes cannot be forked here")
    from multiprocessing import forkserver

    folder, root = str(_TESTS / "loaded"), str(_TESTS.parent)
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["loaded_process"])
    with pytest.MonkeyPatch.context() as patch:
        given = os.environ.get("PYTHONPATH", "")
        patch.setenv("PYTHONPATH", os.pathsep.join(filter(None, [folder, root, given])))
        patch.setenv("JEAT_GRAPH_LOAD", "1")
        forkserver.ensure_running()
    sys.path.append(folder)
    yield context
    sys.path.remove(folder)
    # It ends when its processes have: those that a failed test's traceback still holds would be waited for.
    for child in multiprocessing.active_children():
        child.kill()
        child.join()
    # It counts the time of its processes as its own, and we count its time when it has ended.
    forkserver._forkserver._stop()


@pytest.fixture(scope="session")
def start(loaded):
    """Start `jeat-graph` in a process that begins with all loaded; `loaded/started.py` has what it gives."""
    from started import Started

    def begin(*arguments: object, env: dict[str, str] | None = None, stdin: Path | None = None) -> Started:
        return Started(loaded, [str(argument) for argument in arguments], env, stdin)

    return begin


@pytest.fixture(scope="session")
def call(start):
    """Run `jeat-graph` to its end in a process that begins with all loaded."""
    from started import completed

    def run(
        *arguments: object, given: bytes = b"", env: dict[str, str] | None = None, timeout: float = 600.0
    ):
        return completed(start(*arguments, env=env), given, timeout)

    return run


@pytest.fixture(scope="session")
def small_plots():
    """A context in which plots of a comparison are coarse, and of one track: most of the time goes there."""
    from jeat_graph.drawing import comparison

    @contextmanager
    def small():
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(comparison, "MOST_TRACKS", 1)
            patch.setitem(comparison._STYLE, "figure.dpi", 40)
            yield

    return small


@pytest.fixture
def forked_workers(loaded, monkeypatch):
    """What the package does in workers begins with all loaded there too; for tests of what workers do."""
    ours = multiprocessing.get_context

    def context(method: str | None = None):
        return loaded if method == "spawn" else ours(method)

    monkeypatch.setattr("multiprocessing.get_context", context)
