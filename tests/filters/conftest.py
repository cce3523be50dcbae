"""Makes the dense oracle importable by the tests of this folder."""

import importlib.util
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def dense():
    spec = importlib.util.spec_from_file_location("dense_kalman", Path(__file__).parent / "dense.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
