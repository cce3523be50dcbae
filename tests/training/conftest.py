"""What the tests of training share."""

from __future__ import annotations

import contextlib

import pytest

from .small_sets import write_segment


@pytest.fixture(autouse=True)
def one_thread():
    """Sums in one order, whatever the machine."""
    with contextlib.suppress(ImportError):
        import torch

        torch.set_num_threads(1)


@pytest.fixture
def no_plot(monkeypatch):
    """A training without its plot, for tests that do not look at it: to draw takes as long as to learn."""
    monkeypatch.setattr("jeat_graph.training.procedure.draw_log", lambda rows, path: None)


@pytest.fixture(scope="session")
def small_set(tmp_path_factory):
    """A data set of two segments."""
    root = tmp_path_factory.mktemp("sets") / "small"
    for segment in range(2):
        write_segment(root / "segments" / f"{segment:06d}", segment)
    return root
