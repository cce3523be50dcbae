"""When rows of living tracks are given out."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.filters import gap_survival
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.smoothers.histories import Existence, Histories, StepRecord
from jeat_graph.smoothers.rows import Called, RowOutput
from jeat_graph.smoothers.state_rts import FilterRecord

STATES, STEP_S, LAG_S = 5, 0.125, 1.0
AS_IT_IS = RowOutput(lambda mean: mean, lambda _, covariance: covariance)


def step(t, ids):
    """A step in which a sensor found all tracks, none of which move."""
    n = len(ids)
    mean = np.zeros((n, 2, STATES))
    P, F = np.tile(np.eye(STATES), (n, 2, 1, 1)), np.tile(np.eye(STATES), (n, 1, 1, 1))
    ids, yes, gaps = np.array(ids), np.ones(n, dtype=np.bool_), gap_survival.no_gaps()
    used, missed = np.ones(n, dtype=np.int64), np.zeros(n)
    scan = FilterRecord(ids, F, mean, 2.0 * P, mean, P, np.zeros(n, dtype=np.int64))
    return StepRecord(t, False, ids, [scan], np.ones(n), used, yes, missed, yes, gaps, gaps)


@pytest.mark.parametrize("track_id", [1, 2, 3, 8])
def test_the_older_half_of_two_lags_is_given_out_when_they_have_gone_by(track_id):
    histories = Histories(LAG_S, Existence(ModelConstants()), AS_IT_IS)
    times, parts = np.arange(80) * STEP_S, []
    for now in times.tolist():
        histories.take(step(now, [track_id]), [Called(track_id)])
        rows = histories.drain()[0]
        if len(rows):
            parts.append((now, rows))
    (first, rows), *others = parts
    assert LAG_S < first - rows[0] <= 2.0 * LAG_S + STEP_S, "the first ones sooner, as the identity says"
    for now, rows in others:
        assert now - rows[0] == 2.0 * LAG_S + STEP_S
        assert now - rows[-1] == LAG_S
    given = np.concatenate([rows for _, rows in parts] + [histories.finish()[0]])
    np.testing.assert_array_equal(given, times)


def test_tracks_that_began_together_are_not_all_given_out_at_once():
    histories = Histories(LAG_S, Existence(ModelConstants()), AS_IT_IS)
    ids, first = [1, 2, 3, 4, 5], {}
    for now in (np.arange(20) * STEP_S).tolist():
        histories.take(step(now, ids), [Called(k) for k in ids])
        for k in histories.drain()[1].tolist():
            first.setdefault(k, now)
    assert len(set(first.values())) == len(ids)
