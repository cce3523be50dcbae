"""Sensors that nobody declared: believed as far as the others bear them out."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.config.kernel_form import kernel_model
from jeat_graph.config.reading import load_config
from jeat_graph.data.detections import Detections
from jeat_graph.runs.declaring import fit_input
from jeat_graph.tracking.tracker import Tracker

RATE_HZ = 10.0
STEPS = 300
GHOSTS = ((900.0, 500.0, 60.0, 40.0), (500.0, 600.0, 50.0, 40.0), (200.0, 520.0, 70.0, 50.0))


def follow(sensors, overrides=(), false=("poor",)):
    """Track three cars seen by all sensors; those in `false` also see three things that are none."""
    rng = np.random.default_rng(3)
    names = {name: {"rate_hz": RATE_HZ} for name in sensors}
    declared = [f"sensors.{name}={{rate_hz: {RATE_HZ}}}" for name in names]
    tracker = Tracker(load_config("default", [*declared, "smoother.engine=none", *overrides]))
    reported = []
    for k in range(STEPS):
        t = k / RATE_HZ
        x = 100.0 + 30.0 * (t % 30.0)
        cars = np.array([[x, y, 60.0, 40.0] for y in (100.0, 220.0, 340.0)])
        scans = []
        for name in sensors:
            seen = cars[rng.random(3) < 0.9]
            if name in false:
                seen = np.concatenate([seen, np.array(GHOSTS)[rng.random(3) < 0.8]])
            noisy = seen + rng.normal(0.0, 1.0, seen.shape)
            scans.append((t, name, noisy, np.full(len(noisy), 0.8)))
        reported.append(tracker.step(scans))
    return tracker, reported


def false_rows(reported, since=STEPS // 2):
    return sum(int((table.boxes[:, 1] > 450.0).sum()) for table in reported[since:])


def trust(tracker):
    return dict(zip(tracker.sensor_names, tracker.snapshot().scene.trust.tolist(), strict=True))


def test_a_sensor_that_is_alone_where_another_looks_loses_its_weight():
    tracker, reported = follow(("good", "poor"))
    found = trust(tracker)
    assert found["good"] > 0.8
    assert found["poor"] < 0.2
    assert false_rows(reported) == 0


def test_without_regard_to_disagreement_what_it_sees_alone_is_reported():
    _, reported = follow(("good", "poor"), ["lifecycle.disagreement=0"])
    assert false_rows(reported) > 100


def test_cars_are_reported_all_the_same():
    _, reported = follow(("good", "poor"))
    assert np.mean([np.sum(table.boxes[:, 1] < 450.0) for table in reported[STEPS // 2 :]]) > 2.5


def test_two_good_sensors_are_not_disturbed_by_a_third():
    tracker, reported = follow(("good", "other", "poor"))
    found = trust(tracker)
    assert min(found["good"], found["other"]) > 0.8 > 0.5 > found["poor"]
    assert false_rows(reported) < 0.05 * len(GHOSTS) * STEPS / 2


def test_of_a_sensor_alone_nothing_is_learnt():
    lifecycle = load_config("default").lifecycle
    tracker, _ = follow(("poor",))
    assert trust(tracker)["poor"] == pytest.approx(lifecycle.agreement_prior**lifecycle.disagreement)


def test_a_sensor_may_be_believed_whatever_the_others_say():
    tracker, _ = follow(("good", "poor"), ["sensors.poor.disagreement=0"])
    assert trust(tracker)["poor"] == 1.0


def test_sensors_that_highway_does_not_know_have_to_earn_their_trust():
    """Its own two do not: in the dark only one of them sees."""
    rng = np.random.default_rng(0)
    t = np.repeat(np.arange(20) / 10.0, 3)
    names = np.tile(["rgb", "evt", "third"], 20)
    seen = Detections.from_rows(t, names, rng.uniform(50.0, 90.0, (60, 4)), np.full(60, 0.9))
    config, _ = fit_input(load_config("highway", ("input.undeclared=declare",)), seen)
    prior = dict(zip(config.sensor_names, kernel_model(config).sensors.prior_trust, strict=True))
    assert prior["rgb"] == prior["evt"] == 1.0
    assert prior["third"] == pytest.approx(0.91**12)
