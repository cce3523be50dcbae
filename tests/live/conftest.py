"""Short recordings for the tests of live use; with JEAT_GRAPH_FULL=1 the long form of each runs."""

from __future__ import annotations

import sys
import types
from pathlib import Path

import pytest

from jeat_graph.cli.main import main

# The helpers beside this file, as `live_tests.brokers` and so on: tests are no package to be imported.
_package = types.ModuleType("live_tests")
_package.__path__ = [str(Path(__file__).parent)]
sys.modules["live_tests"] = _package


@pytest.fixture(scope="session")
def simulated(tmp_path_factory):
    """Make `detections.csv` and `gt.csv` of some simulated seconds, once for the same; the folder."""
    made: dict[tuple[int, float, str], Path] = {}

    def make(seed: int, duration_s: float = 1.0, scenario: str = "night") -> Path:
        key = (seed, duration_s, scenario)
        if key not in made:
            folder = tmp_path_factory.mktemp("simulated")
            options = ["--duration", str(duration_s), "--seed", str(seed)]
            assert main(["simulate", scenario, "--out", str(folder), *options]) == 0
            made[key] = folder
        return made[key]

    return make
