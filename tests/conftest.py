"""What all tests share."""

import os

import pytest
from hypothesis import settings

# The first call of a compiled function compiles it, which no deadline of a test should include. Examples
# follow from the test alone, so that a tree passes or fails everywhere, in whatever order the tests run.
settings.register_profile("jeat-graph", deadline=None, derandomize=True)
settings.load_profile("jeat-graph")


@pytest.fixture(scope="session")
def full() -> bool:
    """Whether the long form of the tests is asked for."""
    return os.environ.get("JEAT_GRAPH_FULL", "") not in ("", "0")
