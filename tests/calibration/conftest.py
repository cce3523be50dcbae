import importlib.util
import sys
from pathlib import Path

import pytest

_spec = importlib.util.spec_from_file_location(
    "calibration_synthetic", Path(__file__).with_name("synthetic.py")
)
assert _spec is not None
assert _spec.loader is not None
synthetic = importlib.util.module_from_spec(_spec)
sys.modules["calibration_synthetic"] = synthetic
_spec.loader.exec_module(synthetic)


@pytest.fixture(scope="session")
def known():
    """The module that makes recordings of known parameters."""
    return synthetic


@pytest.fixture(scope="session")
def recordings():
    return [synthetic.recording(seed) for seed in (1, 2)]
