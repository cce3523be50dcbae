"""Frames and scans that a format cannot say were empty."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.errors import DataError
from jeat_graph.data.tables.frame_filling import fill_frames, gap_times


@given(st.sets(st.integers(1, 40), max_size=9), st.integers(0, 60))
def test_a_known_length_gives_every_frame(seen, last):
    frames = np.array(sorted(seen), dtype=np.int64)
    assert fill_frames(frames, "f", last).tolist() == list(range(1, max([last, *seen]) + 1))


@given(st.sets(st.integers(1, 40), min_size=1, max_size=9))
def test_without_a_length_the_frames_go_from_first_to_last(seen):
    frames = np.array(sorted(seen), dtype=np.int64)
    assert fill_frames(frames, "f").tolist() == list(range(min(seen), max(seen) + 1))


@given(st.sets(st.integers(0, 200), min_size=2, max_size=60), st.floats(-0.3, 0.3), st.floats(1, 200))
def test_scans_on_a_jittering_clock_are_found_missing_once_each(ticks, jitter, rate):
    ticks = np.array(sorted(ticks))
    # Neighbours off by less than half a period, in opposite directions.
    times = (ticks + jitter * 0.5 * (-1.0) ** np.arange(len(ticks))) / rate
    found = gap_times(times, rate, "f")
    nominal = np.setdiff1d(np.arange(ticks[0], ticks[-1] + 1), ticks) / rate
    assert len(found) == len(nominal)
    assert np.all(np.abs(found - nominal) <= 0.16 / rate)


def test_a_wrong_time_unit_does_not_fill_the_memory():
    with pytest.raises(DataError, match="is the rate right"):
        gap_times(np.array([0.0, 1e9]), 100.0, "f")
