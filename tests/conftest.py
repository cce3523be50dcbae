"""What all tests share."""

import os

import pytest
from hypothesis import settings

# The first call of a compiled function compiles it, which no deadline of a test should include. Examples
# follow from the test and from the constants in the modules that are loaded, not from a clock: what a test
# counts over its examples still differs a little with what ran before it, and its bound must allow for that.
settings.register_profile("jeat-graph", deadline=None, derandomize=True)
settings.load_profile("jeat-graph")


@pytest.fixture(scope="session")
def full() -> bool:
    """Whether the long form of the tests is asked for."""
    return os.environ.get("JEAT_GRAPH_FULL", "") not in ("", "0")
