"""Stitching in the tracker: a vehicle that vanishes for a while keeps its identity in the smoothed table."""

from __future__ import annotations

import numpy as np
import pytest

from .conftest import make_tracker, recording, run

TWO_CARS = (
    (0.0, 99.0, {}),
    (0.0, 99.0, {"start": (900.0, 500.0), "velocity": (-100.0, 0.0)}),
)
VANISHED = recording(duration=4.5, cars=TWO_CARS, blind=((1.5, 3.0),))


@pytest.mark.parametrize("engine", ["full", "rts"])
def test_fragments_of_one_vehicle_become_one_track_with_its_first_identity(engine):
    tracker = make_tracker(f"smoother.engine={engine}")
    causal = run(tracker, VANISHED)
    table = tracker.finish()
    assert len(np.unique(causal.track_id)) == 4
    assert np.unique(table.track_id).tolist() == sorted(np.unique(causal.track_id).tolist())[:2]
    assert tracker.smoother_counts["stitched"] == 2


def test_the_joined_track_has_rows_in_the_gap_near_the_truth():
    tracker = make_tracker("smoother.engine=rts")
    run(tracker, VANISHED)
    table = tracker.finish()
    steps = np.unique(VANISHED.scan_t)
    for identity in np.unique(table.track_id):
        mine = table.take(table.track_id == identity)
        assert np.array_equal(mine.t, steps)
        x = 200.0 + 120.0 * mine.t if mine.mean[0, 0] < 500.0 else 900.0 - 100.0 * mine.t
        assert np.abs(mine.mean[:, 0] - x).max() < 12.0


@pytest.mark.parametrize("rate_hz", [0.5, 1.0, 20.0])
def test_a_fragment_that_lived_between_two_rows_joins_the_others(rate_hz):
    """The joint changes at most which rows there are: one at each time that the rate asks for."""
    blinking = recording(duration=4.5, cars=TWO_CARS, blind=((1.2, 1.6), (1.8, 2.2)))
    options = ("smoother.engine=rts", "lifecycle.max_gap_confirmed_s=0.15")
    every, some = make_tracker(*options), make_tracker(*options, f"smoother.output_rate_hz={rate_hz}")
    run(every, blinking)
    run(some, blinking)
    every, some = every.finish(), some.finish()
    kept = every.take(np.isclose(every.t * rate_hz % 1.0, 0.0, atol=1e-6))
    assert len(np.unique(kept.track_id)) == 2
    assert np.array_equal(some.t, kept.t)
    assert np.array_equal(some.mean, kept.mean)


def test_stitching_can_be_switched_off():
    tracker = make_tracker("smoother.engine=rts", "smoother.stitch=false")
    causal = run(tracker, VANISHED)
    table = tracker.finish()
    assert np.array_equal(np.unique(table.track_id), np.unique(causal.track_id))
    assert tracker.smoother_counts["stitched"] == 0


def test_a_gap_longer_than_the_limit_is_not_bridged():
    tracker = make_tracker("smoother.engine=rts", "smoother.stitch_max_gap_s=1.2")
    run(tracker, VANISHED)
    assert len(np.unique(tracker.finish().track_id)) == 4


def test_another_vehicle_that_appears_elsewhere_is_not_joined():
    cars = ((0.0, 1.5, {}), (3.0, 9.0, {"start": (900.0, 500.0), "velocity": (-100.0, 0.0)}))
    tracker = make_tracker("smoother.engine=rts")
    run(tracker, recording(duration=4.5, cars=cars))
    assert len(np.unique(tracker.finish().track_id)) == 2


def test_stitching_leaves_the_causal_table_alone():
    stitched = run(make_tracker("smoother.engine=rts"), VANISHED)
    plain = run(make_tracker("smoother.engine=none"), VANISHED)
    assert np.array_equal(stitched.mean, plain.mean)
    assert np.array_equal(stitched.track_id, plain.track_id)
