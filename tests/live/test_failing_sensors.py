"""Sensors that fail: identities survive a drop-out, and rubbish loses its weight."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from jeat_graph.config.reading import load_config
from jeat_graph.data.detections import Scan
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.live.health import SensorHealth
from jeat_graph.live.late import LiveTracker
from jeat_graph.tracking.tracker import Tracker

TWO = ("sensors.rgb.rate_hz=20", "sensors.evt.rate_hz=100")
CONFIG = load_config("default", ["smoother.engine=none", *TWO])
START, SPEED = np.array([[200.0, 200.0], [700.0, 300.0], [400.0, 500.0]]), np.array([30.0, -30.0, 25.0])


def cars(t, rng):
    """Boxes of three cars that drive all the time, as a sensor sees them."""
    centre = START + np.column_stack([SPEED * t, 0.0 * SPEED]) + rng.normal(0.0, 0.7, (3, 2))
    return np.column_stack([centre - 20.0, np.full((3, 2), 40.0)])


def scans_of(seconds=12.0, silent=("", 0.0, 0.0)):
    """Pictures at 20 Hz and events at 100 Hz; one of them silent for a while."""
    rng = np.random.default_rng(8)
    out = []
    for sensor, rate in (("evt", 100.0), ("rgb", 20.0)):
        times = (np.arange(int(seconds * rate)) + 0.2) / rate
        out += [
            Scan(float(t), sensor, cars(t, rng), np.full(3, 0.95))
            for t in times
            if not (sensor == silent[0] and silent[1] <= t < silent[2])
        ]
    return sorted(out, key=lambda scan: scan.t)


@pytest.mark.parametrize("sensor", ["rgb", "evt"])
def test_identities_survive_five_seconds_without_one_sensor(sensor):
    live, health, events = LiveTracker(Tracker(CONFIG)), SensorHealth(CONFIG), []
    reported = {}
    for scan in scans_of(silent=(sensor, 4.0, 9.0)):
        arrival = live.step(scan)
        reported[scan.t] = arrival.table.track_id.tolist()
        events += health.saw([scan], arrival.t)
    assert all(ids == [1, 2, 3] for t, ids in reported.items() if t > 1.0)
    assert [(event.what, event.sensor) for event in events] == [("silent", sensor), ("back", sensor)]
    assert 4.9 <= events[0].t <= 5.1
    assert 9.0 <= events[1].t <= 9.1


@pytest.mark.parametrize("latency", [-2.0, -0.5, 2.0])
def test_a_clock_that_is_known_to_be_off_is_no_silence_and_hides_none(latency):
    config = load_config("default", ["smoother.engine=none", *TWO, f"sensors.rgb.latency_s={latency}"])
    live, health, events = LiveTracker(Tracker(config)), SensorHealth(config), []
    for scan in scans_of(8.0, silent=("rgb", 4.0, 9.0)):
        shown = replace(scan, t=scan.t + latency) if scan.sensor == "rgb" else scan
        arrival = live.step(shown)
        events += health.saw(arrival.taken, arrival.t)
    assert [(event.what, event.sensor) for event in events] == [("silent", "rgb")]
    assert 4.9 <= events[0].t <= 5.1


def test_identities_survive_when_the_silent_sensor_was_the_only_one_for_a_moment():
    """Silence is no miss: without any scan tracks are as real as they were."""
    tracker = Tracker(CONFIG)
    for scan in scans_of(4.0):
        tracker.step(scan)
    ahead = tracker.predict(4.5)
    assert ahead.track_id.tolist() == [1, 2, 3]
    assert (ahead.existence <= tracker.causal().existence).all()
    assert (ahead.existence > 0.5).all()


def test_a_sensor_whose_clutter_rises_tenfold_loses_weight_and_is_named():
    rng = np.random.default_rng(2)
    health, tracker = SensorHealth(CONFIG), Tracker(CONFIG)
    clutter, events = [], []
    for scan in scans_of(10.0):
        if scan.sensor == "evt" and scan.t > 3.0:
            false = np.column_stack([rng.uniform((0, 0), (1200, 680), (12, 2)), np.full((12, 2), 30.0)])
            scan = replace(
                scan,
                boxes=np.concatenate([scan.boxes, false]),
                scores=np.concatenate([scan.scores, np.full(12, 0.15)]),
            )
        table = tracker.step(scan)
        health.saw([scan], scan.t)
        events += health.judge(tracker.sensor_states(), scan.t)
        clutter.append(tracker.sensor_states()["evt"].clutter)
    assert clutter[300] < 1.0 < 5.0 < clutter[-1]
    assert [(event.what, event.sensor) for event in events] == [("rubbish", "evt")]
    assert "weighs less" in events[0].text
    assert {1, 2, 3} <= set(table.track_id.tolist())


def with_rubbish(scan, kind, count, score, fixed, rng):
    """A scan with false boxes: anywhere, another place each time, or always at the same places."""
    anywhere, near = rng.uniform(*FIELD, (count, 2)), fixed + rng.normal(0.0, 0.5, fixed.shape)
    places = near if kind == "standing" else anywhere
    boxes = np.column_stack([places, np.full((count, 2), 30.0)])
    return replace(
        scan,
        boxes=np.concatenate([scan.boxes, boxes]),
        scores=np.concatenate([scan.scores, np.full(count, score)]),
    )


FIELD = ((0.0, 0.0), (1200.0, 680.0))


def test_rubbish_with_good_scores_is_named_and_harms_no_track(full):
    """However many, wherever: the tracks of what is real keep their identities."""

    @settings(max_examples=40 if full else 3, deadline=None, phases=(Phase.generate,))
    @given(
        st.sampled_from((("evt", "anywhere"), ("evt", "standing"), ("rgb", "anywhere"))),
        st.integers(12, 18),
        st.floats(0.8, 0.95),
        st.integers(0, 2**31),
    )
    def holds(which, count, score, seed):
        sensor, kind = which
        rng, health, tracker, events = np.random.default_rng(seed), SensorHealth(CONFIG), Tracker(CONFIG), []
        fixed = rng.uniform(*FIELD, (count, 2))
        for k, scan in enumerate(scans_of(10.0)):
            if scan.sensor == sensor and scan.t > 3.0:
                scan = with_rubbish(scan, kind, count, score, fixed, rng)
            table = tracker.step(scan)
            health.saw([scan], scan.t)
            if k % 20 == 0:
                events += health.judge(tracker.sensor_states(), scan.t)
        assert {1, 2, 3} <= set(table.track_id.tolist())
        # What one sensor finds at the same places all the time may be a row of parked vehicles.
        if kind == "anywhere":
            assert (events[0].what, events[0].sensor) == ("rubbish", sensor)
            assert len(table) <= 4

    holds()


def test_a_few_false_boxes_are_no_rubbish():
    tracker, health = Tracker(CONFIG), SensorHealth(CONFIG)
    rng, events = np.random.default_rng(0), []
    for k, scan in enumerate(scans_of(8.0)):
        tracker.step(with_rubbish(scan, "anywhere", 1, 0.3, np.zeros((1, 2)), rng))
        health.saw([scan], scan.t)
        if k % 20 == 0:
            events += health.judge(tracker.sensor_states(), scan.t)
    assert not events


def test_a_sensor_whose_boxes_are_far_off_gets_a_greater_noise():
    rng = np.random.default_rng(2)
    tracker = Tracker(CONFIG)
    states = []
    for scan in scans_of(14.0):
        if scan.sensor == "rgb" and scan.t > 3.0:
            boxes = scan.boxes.copy()
            boxes[:, :2] += rng.normal(0.0, 12.0, (3, 2))
            scan = replace(scan, boxes=boxes)
        tracker.step(scan)
        states.append(tracker.sensor_states())
    before, after, c = states[300], states[-1], ModelConstants()
    assert after["rgb"].noise_scale > 1.1 * before["rgb"].noise_scale
    # No sensor that is compared with another one is taken to be better than `compared_std`.
    best = pytest.approx((c.compared_std / c.side_std) ** 2)
    assert before["evt"].noise_scale == best
    assert after["evt"].noise_scale == best
