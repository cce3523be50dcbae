"""Stretches of any file are those of an indexed one."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.io.events import reader, words
from jeat_graph.io.events.converting import convert
from jeat_graph.io.events.opening import open_events
from jeat_graph.io.events.stretches import open_stretches

from .test_writers import recording, write


@pytest.mark.parametrize("order", ["forwards", "anyhow"])
def test_any_stretch_is_that_of_the_index(tmp_path, order, monkeypatch):
    monkeypatch.setattr(words, "PIECE_ROWS", 1000)
    monkeypatch.setattr(reader, "PIECE_ROWS", 1000)
    events = recording(n=12_000)
    write(events, tmp_path / "e.raw", "evt3")
    with open_events(tmp_path / "e.raw") as source:
        convert(source, tmp_path / "e.h5")
    starts = np.linspace(0, int(events.t_us[-1]), 30).astype(int)
    if order == "anyhow":
        np.random.default_rng(0).shuffle(starts)
    with open_stretches(tmp_path / "e.raw") as one, open_stretches(tmp_path / "e.h5") as other:
        assert type(one) is not type(other)
        assert (one.size_px, one.duration_us) == (other.size_px, other.duration_us)
        for start in starts.tolist():
            found, expected = one.between(start, start + 4000), other.between(start, start + 4000)
            np.testing.assert_array_equal(found.t_us, expected.t_us)
            np.testing.assert_array_equal(found.x, expected.x)
