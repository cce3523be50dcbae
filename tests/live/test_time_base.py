"""Times far from all others: one scan does not end a run, and a clock that is set back does not either."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.data.detections import Scan
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.live.late import LiveTracker
from jeat_graph.tracking.tracker import Tracker

CONFIG = load_config("default", ["smoother.lag_s=0.3", "image.width=1920"])
COLUMNS = ("t", "track_id", "boxes", "existence", "mean", "var", "used")


def scan(t, sensor="rgb", since=0.0):
    return Scan(t, sensor, [[100.0 + 20.0 * (t - since), 100.0, 40.0, 30.0]], [0.9])


def both(begin, seconds, since=0.0):
    """Scans of two sensors by time."""
    scans = [scan(begin + k / 20, "rgb", since) for k in range(int(20 * seconds))]
    scans += [scan(begin + (k + 0.4) / 50, "evt", since) for k in range(int(50 * seconds))]
    return sorted(scans, key=lambda one: one.t)


def run(scans, policy="rewind", file=None):
    live, tables, rows, said = LiveTracker(Tracker(CONFIG), policy), [], [], []
    for k, one in enumerate(scans):
        if file is not None and k % 13 == 7:
            live.save(file)
            live, _ = LiveTracker.load(file)
        said.append(live.step(one))
        tables.append(said[-1].table)
        if k % 10 == 0:
            rows.append(live.drain_smoothed())
    rows.append(live.finish())
    return said, Trajectories.concatenate(tables), Trajectories.concatenate(rows), live


def assert_equal(one, other):
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


@pytest.mark.parametrize("policy", ["rewind", "skip", "refuse"])
@pytest.mark.parametrize("jump_s", [60.0, 1e6])
@pytest.mark.parametrize("sensor", ["rgb", "evt"])
def test_one_scan_from_the_future_changes_nothing(policy, jump_s, sensor):
    scans = both(0.0, 3.0)
    plain, usual, smoothed, _ = run(scans, policy)
    said, tables, rows, live = run([*scans[:80], scan(1.2 + jump_s, sensor, jump_s), *scans[80:]], policy)
    assert [len(one.held) for one in said] == [0] * 80 + [1] + [0] * (len(scans) - 80)
    assert [one.t for arrival in said for one in arrival.refuted] == [1.2 + jump_s]
    assert live.lateness.summary()[sensor].dropped == 1
    assert_equal(
        Trajectories.concatenate([tables]),
        Trajectories.concatenate(
            [*[p.table for p in plain[:80]], plain[79].table, *[p.table for p in plain[80:]]]
        ),
    )
    assert_equal(rows, smoothed)
    assert len(usual)


def test_one_of_two_clocks_that_leaps_is_corrected_and_ends_nothing():
    scans = both(0.0, 4.0)
    wrong = [scan(one.t + 60.0, "evt") if one.sensor == "evt" and one.t > 1.0 else one for one in scans]
    said, _, _, live = run(wrong)
    assert said[-1].t == pytest.approx(max(one.t for one in scans), abs=1e-3)
    assert live.lateness.dropped == 0


@pytest.mark.parametrize("alone", [False, True])
@pytest.mark.parametrize("policy", ["rewind", "skip", "refuse"])
def test_a_recording_that_pauses_for_an_hour_loses_nothing(alone, policy):
    """The state is that of tracking in order; the first answers after the pause come by some scans later."""
    scans = [*both(0.0, 1.0), *both(3600.0, 1.0, 3600.0)]
    if alone:
        scans = [one for one in scans if one.sensor == "rgb"]
    said, _, rows, live = run(scans, policy)
    tracker = Tracker(CONFIG)
    for one in scans:
        last = tracker.step(one)
    assert_equal(said[-1].table, last)
    assert_equal(rows, tracker.finish())
    assert sum(bool(one.held) for one in said) <= 2
    assert not any(one.dropped or one.refuted or one.reset for one in said)
    assert live.lateness.summary()["rgb"].dropped == 0


@pytest.mark.filterwarnings("ignore:.*median step of 10 s")
def test_a_sensor_with_long_pauses_is_taken_at_once():
    live = LiveTracker(Tracker(CONFIG))
    waits = [bool(live.step(scan(10.0 * k, since=10.0 * k)).held) for k in range(12)]
    assert waits == [False, True, True, *[False] * 9]
    assert live.time == 110.0


@pytest.mark.parametrize("alone", [False, True])
@pytest.mark.parametrize("policy", ["rewind", "skip"])
def test_a_clock_that_is_set_back_begins_a_new_time(alone, policy, tmp_path):
    first, second = both(5000.0, 2.0, 5000.0), both(1400.0, 8.0, 1400.0)
    if alone:
        first, second = ([one for one in part if one.sensor == "rgb"] for part in (first, second))
    said, tables, rows, live = run([*first, *second], policy)
    assert sum(one.reset for one in said) == 1
    assert not any(one.dropped or one.refuted for one in said), "what waited is taken"
    begun = next(k for k, one in enumerate(said) if one.reset)
    assert 1404.9 < said[begun].t < 1405.2
    assert live.time == second[-1].t
    # Tracks are other ones, with identities greater than all before; the smoothed rows have both times.
    old, new = tables.t >= 5000.0, tables.t < 5000.0
    assert new.sum() > 50
    assert tables.track_id[old].max() < tables.track_id[new].min()
    assert set(rows.track_id[rows.t < 5000.0]) == set(tables.track_id[new])
    assert set(rows.track_id[rows.t >= 5000.0]) == set(tables.track_id[old])
    assert rows.t[rows.t < 5000.0].min() < 1400.5
    again = run([*first, *second], policy, tmp_path / "state.npz")
    assert_equal(again[1], tables)
    np.testing.assert_array_equal(again[2].track_id, rows.track_id)


def test_late_scans_of_one_sensor_do_not_turn_time_back_while_another_goes_on():
    scans = both(100.0, 8.0, 100.0)
    wrong = [scan(one.t - 60.0, "evt") if one.sensor == "evt" and one.t > 101.0 else one for one in scans]
    said, _, _, _ = run(wrong)
    assert not any(one.reset for one in said)
    assert said[-1].t == pytest.approx(max(one.t for one in scans), abs=1e-3)
