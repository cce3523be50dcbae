"""Stitching in the tracker: a vehicle that vanishes for a while keeps its identity in the smoothed table."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph import Tracker, load_config
from jeat_graph.data.trajectories import Trajectories

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


SIGN, ON_S, PERIOD_S = np.array([600.0, 500.0, 60.0, 60.0]), 1.5, 3.5


@pytest.fixture(scope="module")
def cars_and_a_sign():
    """Both tables of one detector whose scores say nothing; it takes a sign for a vehicle now and then."""
    rng = np.random.default_rng(1)
    detector = "sensors.one={rate_hz: 15}"
    tracker = Tracker(load_config("default", [detector, "smoother.engine=rts"]), image=(1280, 720))
    tables = []
    for k in range(15 * 20):
        t = k / 15
        x = (150.0 * t + 320.0 * np.arange(4)) % 1280.0
        cars = np.column_stack([x, 100.0 + 90.0 * np.arange(4), np.full(4, 80.0), np.full(4, 50.0)])
        # Behind a pillar in the middle of the picture nothing is found of a car: for .6 s.
        seen = (np.abs(x - 640.0) > 45.0) & (x < 1190.0)
        boxes = np.vstack([cars[seen], SIGN[None][: int(t % PERIOD_S < ON_S and rng.random() < 0.6)]])
        table = tracker.step((t, "one", boxes + rng.normal(0.0, 1.0, boxes.shape), np.ones(len(boxes))))
        tables.append(table)
    return Trajectories.concatenate(tables), tracker.finish()


def at_sign(table):
    place = table.boxes[:, :2] + 0.5 * table.boxes[:, 2:]
    return np.hypot(*(place - SIGN[:2] - 30.0).T) < 20.0


def test_a_thing_that_comes_and_goes_at_its_place_is_not_filled_in_while_a_car_behind_something_is(
    cars_and_a_sign,
):
    _, table = cars_and_a_sign
    # At first a score of one is believed; what it is worth is learnt within seconds.
    away = (table.t > 6.0) & (table.t % PERIOD_S > ON_S + 0.4)
    assert not (at_sign(table) & away).any()
    x = table.boxes[:, 0] + 0.5 * table.boxes[:, 2]
    behind = (np.abs(x - 680.0) < 40.0) & ~at_sign(table)
    passes = 4 * 15.0 * 150.0 / 1280.0
    assert behind.sum() > 0.8 * passes * (80.0 / 150.0) * 15.0
