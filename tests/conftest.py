"""What all tests share."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

# The tests share the cores: the threads of one's linear algebra would only wait for those of the others.
# This is before anything that loads it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# The first call of a compiled function compiles it, which no deadline of a test should include. Examples
# follow from the test and from the constants in the modules that are loaded, not from a clock: what a test
# counts over its examples still differs a little with what ran before it, and its bound must allow for that.
settings.register_profile("jeat-graph", deadline=None, derandomize=True)
settings.load_profile("jeat-graph")


@pytest.fixture(scope="session")
def full() -> bool:
    """Whether the long form of the tests is asked for."""
    return os.environ.get("JEAT_GRAPH_FULL", "") not in ("", "0")


@pytest.fixture(scope="session")
def dying():
    """Make the environment of processes that end at a chosen change to files (`dying/sitecustomize.py`)."""

    def environment(below: Path, at: int = 0, by: int = 9, **more: object) -> dict[str, str]:
        """Where changes count, the number of the fatal one, and the signal; `once`, `log`, `name`."""
        paths = [str(Path(__file__).parent / "dying"), os.environ.get("PYTHONPATH", "")]
        fate = {"below": below, "at": at, "by": int(by), **more}
        return {
            **os.environ,
            "PYTHONPATH": os.pathsep.join(filter(None, paths)),
            **{f"DYING_{key.upper()}": str(value) for key, value in fate.items()},
        }

    return environment
