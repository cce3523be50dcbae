"""Which tracks the causal table reports, and as what."""

import numpy as np
import pytest

from jeat_graph import Tracker, load_config

STEP = 0.05

# Not by scans.
ONLY_BY_TIME = ("output.max_gap_scans=0",)


def follow(overrides=(), steps=30, box=(100.0, 100.0, 40.0, 30.0), velocity=(0.0, 0.0), preset="highway"):
    """Track one vehicle with the RGB camera; returns the tracker, the last table and the last time."""
    tracker = Tracker(load_config(preset, ["smoother.engine=none", *overrides]))
    for k in range(steps):
        t = STEP * k
        moved = np.array([[box[0] + velocity[0] * t, box[1] + velocity[1] * t, box[2], box[3]]])
        table = tracker.step((t, "rgb", moved, [0.95]))
    return tracker, table, t


def test_a_vehicle_is_reported_with_its_box_state_and_identity():
    _, table, t = follow(velocity=(40.0, -20.0))
    assert len(table) == 1
    assert table.t[0] == t
    assert table.track_id[0] == 1
    assert np.allclose(table.boxes[0], [100 + 40 * t, 100 - 20 * t, 40, 30], atol=1.0)
    assert np.allclose(table.mean[0, :2], table.boxes[0, :2] + table.boxes[0, 2:] / 2, atol=1e-9)
    assert np.allclose(table.mean[0, 2:4], [40, -20], atol=2.0)


def test_one_look_confirms_nothing():
    _, table, _ = follow(steps=1, overrides=["lifecycle.confirm_existence=1"])
    assert len(table) == 0


def test_a_track_is_reported_until_the_longest_gap_has_passed():
    for gap, rows in ((0.19, 1), (0.21, 0)):
        tracker, _, t = follow(
            [*ONLY_BY_TIME, "output.max_gap_s=0.2", "output.min_existence=0", "standing.enabled=false"]
        )
        assert len(tracker.step((t + gap, "evt", [], []))) == rows


def test_by_default_a_vehicle_that_one_scan_missed_is_reported_and_after_two_it_is_not():
    tracker, table, t = follow(velocity=(60.0, 0.0), preset="default")
    assert len(table) == 1
    assert [len(tracker.step((t + k * STEP, "rgb", [], []))) for k in (1, 2)] == [1, 0]


def test_until_the_slowest_sensors_next_scan_nothing_is_missed():
    """Of six vehicles the fast sensor sees five, the slow one all until its last two scans."""
    rates = {"slow": 20, "fast": 100}
    sensors = [f"sensors.{name}={{rate_hz: {rate}, disagreement: 0}}" for name, rate in rates.items()]
    options = ["smoother.engine=none", "output.max_gap_scans=0.4", "output.gap_memory=0", *sensors]
    tracker = Tracker(load_config("default", options))
    reported = {}
    for k in range(300):
        t = 0.01 * k
        boxes = np.array([[100.0 + 60.0 * t, 60.0 + 100.0 * n, 40.0, 30.0] for n in range(6)])
        scans = [(t, "fast", boxes[:5], np.full(5, 0.95))]
        if k % 5 == 0:
            shown = 6 if k < 290 else 5
            scans.append((t, "slow", boxes[:shown], np.full(shown, 0.95)))
        reported[k] = len(tracker.step(scans))
    assert {reported[k] for k in range(150, 290)} == {6}
    assert reported[290] == 5


def test_a_doubted_track_is_not_reported():
    tracker, table, t = follow(
        [*ONLY_BY_TIME, "output.max_gap_s=9", "lifecycle.max_gap_confirmed_s=9"], velocity=(60.0, 0.0)
    )
    existence = table.existence[0]
    reported = []
    for k in range(1, 40):
        table = tracker.step((t + k * STEP, "rgb", [], []))
        reported.append(len(table))
        if len(table):
            assert 0.5 <= table.existence[0] < existence
            existence = table.existence[0]
    assert reported[0] == 1
    assert reported[-1] == 0
    assert sorted(reported, reverse=True) == reported


@pytest.mark.parametrize(
    ("box", "clipped"),
    [
        ((-10.0, 100.0, 60.0, 30.0), (0.0, 100.0, 50.0, 30.0)),
        ((1240.0, 100.0, 60.0, 30.0), (1240.0, 100.0, 40.0, 30.0)),
        ((100.0, 705.0, 40.0, 28.0), (100.0, 705.0, 40.0, 15.0)),
        ((100.0, -10.0, 40.0, 30.0), (100.0, 0.0, 40.0, 20.0)),
    ],
)
def test_boxes_are_clipped_to_the_picture_and_states_are_not(box, clipped):
    _, table, _ = follow(box=box)
    assert np.allclose(table.boxes[0], clipped, atol=0.5)
    assert np.allclose(table.mean[0, :2], [box[0] + box[2] / 2, box[1] + box[3] / 2], atol=0.5)


def test_without_clipping_a_box_keeps_its_part_outside_the_picture():
    box = (-10.0, 100.0, 60.0, 30.0)
    _, table, _ = follow(["output.clip=false"], box=box)
    assert np.allclose(table.boxes[0], box, atol=0.5)


def test_a_vehicle_of_which_too_little_is_in_the_picture_is_not_reported():
    inside = (1255.0, 100.0, 40.0, 30.0)  # 25 of its 40 px
    keep = ["lifecycle.leave_picture=false", "image.edge_px=0"]
    assert len(follow([*keep, "output.min_visible=0.6"], box=inside)[1]) == 1
    assert len(follow([*keep, "output.min_visible=0.65"], box=inside)[1]) == 0


def test_a_track_whose_centre_leaves_the_picture_ends():
    for leave, alive in (("true", 0), ("false", 1)):
        tracker, _, _ = follow(
            [f"lifecycle.leave_picture={leave}", "image.edge_px=0"],
            box=(1230.0, 100.0, 40.0, 30.0),
            velocity=(100.0, 0.0),
            steps=10,
        )
        assert tracker.num_tracks == alive


@pytest.mark.parametrize(("sensors", "left"), [(("slow", "fast"), 0), (("slow",), 1)])
def test_a_scan_that_missed_a_vehicle_counts_where_another_sensor_looked_too(sensors, left):
    """Of two sensors neither finds it any more; one that looks alone may just have missed it."""
    declared = [f"sensors.{name}={{rate_hz: 20, disagreement: 0}}" for name in ("slow", "fast")]
    by_scans = ["output.max_gap_scans=0.7", "output.max_gap_s=0.14", "output.scans_of_several=true"]
    tracker = Tracker(load_config("default", ["smoother.engine=none", *by_scans, *declared]))
    reported = []
    for k in range(40):
        seen = np.array([[100.0 + 3.0 * k, 60.0, 40.0, 30.0]])[: 1 if k < 38 else 0]
        reported.append(
            len(tracker.step([(STEP * k, name, seen, np.full(len(seen), 0.95)) for name in sensors]))
        )
    assert reported[37] == 1
    assert reported[38:] == [left, left]


FIT = ["sensors.rgb.score_fit=[[0.2, 0.1], [0.8, 0.9]]", "output.fit_memory_s=0.5"]


def scores_over_time(scores, smoothed, overrides=()):
    """Times at which a vehicle that drives by has a row when its detections have these scores."""
    engine = "rts" if smoothed else "none"
    tracker = Tracker(load_config("highway", [*FIT, *overrides, f"smoother.engine={engine}"]))
    times = []
    for k, score in enumerate(scores):
        t = STEP * k
        table = tracker.step((t, "rgb", np.array([[100.0 + 60.0 * t, 100.0, 40.0, 30.0]]), [score]))
        times += table.t.tolist()
    if smoothed:
        times = tracker.finish().t.tolist()
    return np.array(times)


@pytest.mark.parametrize("smoothed", [False, True])
def test_a_track_has_rows_only_while_its_scores_say_that_its_box_fits(smoothed):
    """From 2 s on the scores say .1 where they said .9: the mean over .5 s is .5 after .5 ln 2 = .35 s.

    It counts the detection of 2 s. In hindsight it is .5 just at 2 s.
    """
    scores = np.where(np.arange(80) < 40, 0.8, 0.2)
    until = 2.0 if smoothed else 2.0 - STEP + 0.5 * np.log(2.0)
    times = scores_over_time(scores, smoothed)
    assert times.max() == pytest.approx(until, abs=1.5 * STEP)
    assert np.diff(times).max() == pytest.approx(STEP)
    always = scores_over_time(scores, smoothed, ["output.min_fit=0"])
    assert always.max() == pytest.approx(79 * STEP)
    nothing_said = scores_over_time(scores, smoothed, ["sensors.rgb.score_fit=[]"])
    assert nothing_said.max() == pytest.approx(79 * STEP)


def test_in_hindsight_a_vehicle_has_rows_as_soon_as_its_box_fits():
    scores = np.where(np.arange(80) < 40, 0.2, 0.8)
    assert scores_over_time(scores, False).min() == pytest.approx(
        2.0 - STEP + 0.5 * np.log(2.0), abs=1.5 * STEP
    )
    assert scores_over_time(scores, True).min() == pytest.approx(2.0, abs=1.5 * STEP)
