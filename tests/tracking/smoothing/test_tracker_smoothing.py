"""The tracker's smoothed trajectories: what is in them, when they are final, and what they leave alone."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from jeat_graph.data.errors import JeatGraphError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.smoothers.rts import filter_track
from jeat_graph.tracking.records import record_tracks
from jeat_graph.tracking.smoothing.online import TrackSmoothers

from .conftest import make_tracker, recording, run

ENGINES = ("fixed-lag", "fixed-lag-rts", "full", "rts")


def equal(a: Trajectories, b: Trajectories) -> bool:
    return all(
        np.array_equal(getattr(a, f.name), getattr(b, f.name)) for f in fields(a) if f.name != "sensors"
    )


@pytest.mark.parametrize("engine", ENGINES)
def test_the_causal_table_is_the_same_with_and_without_a_smoother(one_car, engine):
    plain = run(make_tracker("smoother.engine=none"), one_car)
    assert equal(plain, run(make_tracker(f"smoother.engine={engine}"), one_car))


@pytest.mark.parametrize("engine", ENGINES)
def test_a_track_is_smoothed_from_its_first_detection_to_its_last(one_car, engine):
    tracker = make_tracker(f"smoother.engine={engine}")
    run(tracker, one_car)
    table = tracker.finish()
    assert np.unique(table.track_id).tolist() == [1]
    assert np.array_equal(table.t, np.unique(one_car.scan_t))


def test_identities_are_those_of_the_causal_table():
    cars = ((0.0, 9.0, {}), (0.3, 9.0, {"start": (900.0, 500.0), "velocity": (-100.0, 0.0)}))
    tracker = make_tracker()
    causal = run(tracker, recording(cars=cars))
    smoothed = tracker.finish()
    for identity in np.unique(causal.track_id):
        mine = causal.take(causal.track_id == identity)
        other = smoothed.take(smoothed.track_id == identity)
        row = np.searchsorted(other.t, mine.t)
        assert np.abs(other.mean[row, :2] - mine.mean[:, :2]).max() < 10.0


@pytest.mark.parametrize("engine", ENGINES)
def test_a_gap_is_filled_by_the_motion_model(engine):
    detections = recording(blind=((1.5, 2.1),))
    tracker = make_tracker(f"smoother.engine={engine}")
    run(tracker, detections)
    table = tracker.finish()
    gap = (table.t >= 1.5) & (table.t < 2.1)
    assert gap.sum() == np.sum((np.unique(detections.scan_t) >= 1.5) & (np.unique(detections.scan_t) < 2.1))
    assert not table.used[gap].any()
    x = 200.0 + 120.0 * table.t[gap]
    assert np.abs(table.mean[gap, 0] - x).max() < 4.0


def test_smoothed_positions_are_nearer_to_the_truth_than_causal_ones(one_car):
    tracker = make_tracker()
    causal, smoothed = run(tracker, one_car), tracker.finish()
    late = smoothed.take(np.isin(smoothed.t, causal.t))
    error = [np.sqrt(np.mean((table.mean[:, 0] - 200.0 - 120.0 * table.t) ** 2)) for table in (causal, late)]
    assert error[1] < 0.7 * error[0]


def test_engines_with_a_lag_agree_with_those_without():
    detections = recording(duration=4.0, blind=((1.5, 2.1),))
    tables = {}
    for engine in ENGINES:
        tracker = make_tracker(f"smoother.engine={engine}", "smoother.lag_s=1.5")
        run(tracker, detections)
        tables[engine] = tracker.finish()
    for engine in ENGINES[:3]:
        assert np.array_equal(tables[engine].t, tables["rts"].t)
        # What comes after the lag could still move an estimate, by little of its own uncertainty.
        std = np.sqrt(tables["rts"].var)
        tolerance = 1e-5 if engine == "full" else 0.1
        assert (np.abs(tables[engine].mean - tables["rts"].mean) / std).max() < tolerance
        assert np.allclose(tables[engine].boxes, tables["rts"].boxes, atol=0.5)


@pytest.mark.parametrize("every", [1, 7, 48, 300])
def test_drained_rows_and_the_rest_are_the_whole_table_whenever_they_are_drained(every):
    cars = ((0.0, 1.6, {}), (0.5, 9.0, {"start": (900.0, 500.0), "velocity": (-100.0, 0.0)}))
    detections = recording(duration=4.0, cars=cars)
    whole = make_tracker()
    run(whole, detections)
    drained = make_tracker()
    parts = [
        drained.drain_smoothed() for k, _ in enumerate(drained.run(detections)) if k % every == every - 1
    ]
    assert sum(len(part) for part in parts) > 100
    assert equal(Trajectories.concatenate([*parts, drained.finish()]), whole.finish())


def test_what_was_drained_stays_what_it_was():
    tracker = make_tracker()
    early = None
    for k, _ in enumerate(tracker.run(recording(duration=4.0))):
        if k == 300:
            early = tracker.smoothed()
            final = tracker.drain_smoothed()
    assert 0 < len(final) < len(early)
    assert equal(final, early.take(np.arange(len(final))))


def test_smoothed_trails_the_causal_table_by_nothing_and_ends_with_the_filters_own_estimate(one_car):
    tracker = make_tracker()
    steps = tracker.run(one_car)
    for _ in range(151):
        table = next(steps)
    now = tracker.smoothed()
    assert now.t[-1] == table.t[-1]
    # The filter's jerk follows the size at each step, the smoother's at each measurement: nearly the same.
    assert np.abs(now.mean[-1, :2] - table.mean[0, :2]).max() < 0.05


def test_a_vehicle_never_confirmed_has_no_smoothed_trajectory():
    tracker = make_tracker("lifecycle.confirm_existence=1.0", "lifecycle.method=existence")
    run(tracker, recording(duration=0.2, cars=((0.05, 0.06, {}),)))
    assert len(tracker.finish()) == 0


def test_rows_come_at_the_output_rate(one_car):
    tracker = make_tracker("smoother.output_rate_hz=20")
    run(tracker, one_car)
    t = tracker.finish().t
    assert len(t) == 60
    assert np.allclose(np.diff(t), 0.05, atol=0.0101)


def test_the_output_rate_changes_which_rows_there_are_and_not_what_they_say(one_car):
    tables = []
    for rate in (0, 20):
        tracker = make_tracker(f"smoother.output_rate_hz={rate}")
        run(tracker, one_car)
        tables.append(tracker.finish())
    every, thinned = tables
    assert np.array_equal(every.take(np.isin(every.t, thinned.t)).mean, thinned.mean)


def test_a_vehicle_that_stays_was_there_from_the_start(one_car):
    tracker = make_tracker("smoother.engine=rts")
    run(tracker, one_car)
    assert tracker.finish().existence.min() > 0.9


def test_only_rows_that_are_probable_are_written(one_car):
    tables = []
    for least in (0.0, 0.99999):
        tracker = make_tracker("smoother.engine=rts", f"smoother.min_existence={least}")
        run(tracker, one_car)
        tables.append(tracker.finish())
    every, sure = tables
    assert 0 < len(sure) < len(every)
    np.testing.assert_array_equal(sure.t, every.t[every.existence >= 0.99999])


def test_boxes_are_clipped_to_the_picture_and_centres_are_not():
    detections = recording(cars=((0.0, 9.0, {"start": (1000.0, 300.0), "velocity": (120.0, 0.0)}),))
    tracker = make_tracker()
    run(tracker, detections)
    table = tracker.finish()
    right = table.boxes[:, 0] + table.boxes[:, 2]
    assert right.max() == 1280.0
    leaving = right == 1280.0
    assert (table.mean[leaving, 0] > table.boxes[leaving, 0] + 0.5 * table.boxes[leaving, 2] - 1e-9).all()


def test_steps_at_one_time_give_one_row():
    tracker = make_tracker()
    for k in range(40):
        for sensor in ("rgb", "evt"):
            tracker.step((0.05 * k, sensor, [[100.0 + k, 100.0, 60.0, 40.0]], [0.95]))
    table = tracker.finish()
    assert len(np.unique(table.t)) == len(table)


def test_a_track_that_ends_frees_its_smoother():
    cars = ((0.0, 1.0, {}),)
    tracker = make_tracker()
    run(tracker, recording(duration=4.0, cars=cars))
    smoothers = tracker._smoothers._smoothers
    assert isinstance(smoothers, TrackSmoothers)
    tracker.smoothed()
    assert not smoothers._histories
    assert smoothers.tracks == 1


def test_memory_does_not_grow_with_the_length_of_a_drained_run():
    tracker = make_tracker()
    waiting = []
    for k, _ in enumerate(
        tracker.run(recording(duration=12.0, cars=((0.0, 99.0, {"velocity": (60.0, 5.0)}),)))
    ):
        if k % 240 == 239:
            tracker.drain_smoothed()
            history = tracker._smoothers._smoothers._histories[1]
            waiting.append(len(history.observed) + sum(len(m) for m in history.measurements))
    assert max(waiting[2:]) <= 1.3 * waiting[1]


def test_without_a_smoother_asking_for_smoothed_is_an_error_and_finish_is_empty(one_car):
    tracker = make_tracker("smoother.engine=none")
    run(tracker, one_car)
    with pytest.raises(JeatGraphError, match=r"smoother\.engine"):
        tracker.smoothed()
    assert len(tracker.finish()) == 0


def test_a_finished_tracker_takes_no_more_scans(one_car):
    tracker = make_tracker()
    run(tracker, one_car)
    tracker.finish()
    with pytest.raises(JeatGraphError, match="finished"):
        tracker.step((99.0, "rgb", [[0, 0, 10, 10]], [0.9]))


def test_a_failing_gtsam_is_survived_and_counted(one_car, monkeypatch):
    from jeat_graph.smoothers.gtsam.window import GtsamError, GtsamWindow

    plain = make_tracker()
    run(plain, one_car)
    calls = iter(range(10**6))
    update = GtsamWindow.update

    def failing(self, *arguments):
        if next(calls) == 5:
            raise GtsamError("Indeterminate linear system detected")
        update(self, *arguments)

    monkeypatch.setattr(GtsamWindow, "update", failing)
    tracker = make_tracker()
    run(tracker, one_car)
    table = tracker.finish()
    assert tracker.smoother_counts["rebuilds"] == 1
    assert np.abs(table.mean - plain.finish().mean).max() < 1e-3


def test_the_log_holds_the_measurements_just_as_the_filter_used_them(one_car):
    """A filter over the logged measurements ends where the tracker's own does."""
    overrides = ("smoother.engine=rts", "standing.enabled=false", "size.rate_density=0.01")
    config = make_tracker(*overrides).config
    [one], causal = record_tracks(config, one_car)
    mean, cov = filter_track(one.data)
    assert np.allclose(mean[-1, :, 0], causal.mean[-1, :2], atol=0.01)
    var = np.diagonal(cov[-1, :, :3, :3], axis1=1, axis2=2).T.reshape(-1)
    assert np.allclose(var, causal.var[-1], rtol=0.02)
