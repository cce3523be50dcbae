"""Rows that wait to be fetched: all of them come back, however few fit in memory."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.smoothing.waiting import WaitingRows


def table(first: int, rows: int) -> Trajectories:
    t = np.arange(first, first + rows, dtype=np.float64)
    return Trajectories(
        t=t,
        track_id=np.arange(rows) + 1,
        boxes=np.outer(t, [1.0, 2.0, 3.0, 4.0]),
        existence=np.full(rows, 0.5),
        mean=np.outer(t, np.arange(6.0)),
        var=np.outer(t, np.ones(6)),
        used=np.ones(rows, dtype=np.int64),
        sensors=("rgb",),
    )


def test_rows_beyond_the_bound_come_back_in_order() -> None:
    waiting = WaitingRows(("rgb",), most_in_memory=10)
    waiting.append(table(0, 4))
    waiting.append(table(4, 4))
    with pytest.warns(UserWarning, match="drain_smoothed"):
        waiting.append(table(8, 4))
    for k in range(3, 12):
        waiting.append(table(4 * k, 4))
    kept = Trajectories.concatenate(waiting.peek())
    taken = Trajectories.concatenate(waiting.drain())
    for rows in (kept, taken):
        np.testing.assert_array_equal(rows.t, np.arange(48))
        np.testing.assert_array_equal(rows.boxes, np.outer(np.arange(48.0), [1, 2, 3, 4]))
        assert rows.sensors == ("rgb",)
    assert waiting.drain() == []


def test_few_rows_stay_in_memory_without_a_word() -> None:
    waiting = WaitingRows(("rgb",), most_in_memory=10)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        waiting.append(table(0, 10))
    assert waiting._file is None
    assert len(waiting.drain()[0]) == 10
