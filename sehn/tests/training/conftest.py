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
    """A training that writes down what it would draw: to draw it takes as long as to learn."""

    def told(rows, path):
        path.write_text(repr(rows), encoding="utf-8")

    monkeypatch.setattr("jeat_graph_sehn.training.procedure.draw_log", told)


@pytest.fixture(scope="session")
def small_set(tmp_path_factory):
    """A data set of two segments."""
    root = tmp_path_factory.mktemp("sets") / "small"
    for segment in range(2):
        write_segment(root / "segments" / f"{segment:06d}", segment)
    return root
