"""Rows of the smoothed table where nobody sees a vehicle for a while."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph import Tracker, load_config
from jeat_graph.tracking.smoothing.observation_times import ObservationTimes

STEP = 0.05


def smoothed_rows(engine, seen, overrides=(), velocity=60.0, sensor="rgb"):
    """Times and boxes of a vehicle that has a detection in the scans `seen` (K,)."""
    settings = [f"smoother.engine={engine}", "lifecycle.max_gap_confirmed_s=2", *overrides]
    tracker = Tracker(load_config("highway", settings))
    tables = []
    for k, visible in enumerate(seen):
        box = np.array([[100.0 + velocity * STEP * k, 100.0, 40.0, 30.0]])[: int(visible)]
        tracker.step((STEP * k, sensor, box, np.full(len(box), 0.95)))
        tables.append(tracker.smoothed())
    tables.append(tracker.finish())
    last = tables[-1]
    assert len(np.unique(last.track_id)) == 1
    return last


def hidden(first, last, count=60):
    """Which of `count` scans see it, hidden in those from `first` to `last`."""
    k = np.arange(count)
    return (k < first) | (k > last)


@pytest.mark.parametrize("engine", ["fixed-lag", "fixed-lag-rts", "full", "rts"])
def test_what_is_hidden_for_longer_has_no_rows_meanwhile(engine):
    seen = hidden(20, 31)  # no detection between .95 and 1.6 s
    always = smoothed_rows(engine, seen)
    assert np.allclose(always.t, STEP * np.arange(60))
    bridged = smoothed_rows(engine, seen, ["smoother.max_gap_s=0.66"])
    assert bridged.boxes.tobytes() == always.boxes.tobytes()
    cut = smoothed_rows(engine, seen, ["smoother.max_gap_s=0.64"])
    assert np.allclose(cut.t, STEP * np.flatnonzero(seen))
    assert cut.boxes.tobytes() == always.boxes[seen].tobytes()


def test_what_is_known_to_stand_has_its_rows():
    """The events' camera does not see what stands, so that it finds nothing says nothing."""
    seen = hidden(40, 69, count=90)
    cut = ["smoother.max_gap_s=0.5", "standing.enabled=true"]
    assert np.allclose(smoothed_rows("rts", seen, cut, 0.0, "evt").t, STEP * np.arange(90))
    assert np.allclose(smoothed_rows("rts", seen, cut, 60.0, "evt").t, STEP * np.flatnonzero(seen))


def test_the_time_that_nobody_saw_it_is_that_between_two_detections():
    used = np.array([0, 1, 0, 0, 2, 3, 0])
    t = np.array([0.0, 0.1, 0.2, 0.4, 0.5, 0.7, 1.0])
    n = len(t)
    looks = ObservationTimes(t, np.ones(n), np.ones(n), used, np.zeros(n, dtype=bool), np.ones((n, 2)))
    assert np.allclose(looks.unseen_for(), [0.1, 0.0, 0.4, 0.4, 0.0, 0.0, 0.3])
    assert np.all(looks.select(used == 0).unseen_for() == 0.0)
    assert len(ObservationTimes.empty().unseen_for()) == 0
