"""What the smoothers' tests share."""

import importlib.util
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def chains():
    """The module `chains.py`: tracks from the model, and their exact solution."""
    spec = importlib.util.spec_from_file_location("chains", Path(__file__).parent / "chains.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
