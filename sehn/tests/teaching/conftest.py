"""What the tests of teaching share."""

from __future__ import annotations

import contextlib

import pytest


@pytest.fixture(autouse=True)
def one_thread():
    """Sums in one order, whatever the machine."""
    with contextlib.suppress(ImportError):
        import torch

        torch.set_num_threads(1)
