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


@pytest.mark.parametrize("first", range(20, 40, 3))
def test_a_gap_of_just_so_long_is_bridged_wherever_it_begins(first):
    """Times are binary fractions: .3 s at 20 Hz are now and then a little more."""
    seen = hidden(first, first + 4)
    assert len(smoothed_rows("rts", seen, ["smoother.max_gap_s=0.3"]).t) == 60
    longer = hidden(first, first + 5)
    assert len(smoothed_rows("rts", longer, ["smoother.max_gap_s=0.3"]).t) == 54


@pytest.mark.parametrize("engine", ["fixed-lag", "rts"])
@pytest.mark.parametrize("rate_hz", [10, 5, 4])
def test_gaps_are_those_between_detections_whatever_rows_there_are(engine, rate_hz):
    """The row of a step without a detection says nothing of the steps that have no rows."""
    seen = np.random.default_rng(1).random(60) < 0.7
    seen[[0, -1]] = True
    seen[30:40] = [True, *[False] * 8, True]
    rate = f"smoother.output_rate_hz={rate_hz}"
    always = smoothed_rows(engine, seen, [rate])
    cut = smoothed_rows(engine, seen, [rate, "smoother.max_gap_s=0.42"])
    between = (always.t > 30.5 * STEP) & (always.t < 38.5 * STEP)
    assert between.any()
    assert np.allclose(cut.t, always.t[~between])


def test_a_gap_has_all_of_its_rows_or_none():
    """Where it was known to stand at first it was still there later."""
    t = np.arange(0.0, 2.01, 0.1)
    n = len(t)
    seen = np.concatenate([t[:6], t[12:16], t[20:]])
    held = (t > 0.55) & (t < 0.75)
    looks = ObservationTimes(t, np.ones(n), np.ones(n), np.isin(t, seen).astype(int), held, np.ones((n, 2)))
    assert np.flatnonzero(looks.hidden(seen, 0.3)).tolist() == [16, 17, 18, 19]
    assert not looks.hidden(seen, 0.5).any()
    assert len(ObservationTimes.empty().hidden(seen, 0.3)) == 0


def test_rows_after_the_last_detection_are_those_of_what_stands():
    t = np.array([0.0, 0.1, 0.2, 0.9])
    seen = np.array([0.0, 0.1 + 4e-7])
    for held in (False, True):
        flags = np.array([False, False, held, held])
        looks = ObservationTimes(t, np.ones(4), np.ones(4), np.zeros(4, dtype=int), flags, np.ones((4, 2)))
        assert looks.hidden(seen, 0.3).tolist() == [False, False, not held, not held]
