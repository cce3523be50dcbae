"""Sensors that look at different parts of the picture."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.filters.field_of_view import in_field
from jeat_graph.tracking.tracker import Tracker

RATE_HZ, SECONDS = 10.0, 20.0
LANES = np.arange(60.0, 660.0, 75.0)


def follow(second, overrides=(), ghosts=0):
    """Track walkers to and fro whom `all` sees, and `part` between two places along x (px).

    `ghosts` is the number of things anywhere that `all` takes for walkers too, for a second each.
    """
    rng = np.random.default_rng(4)
    declared = [f"sensors.{name}={{rate_hz: {RATE_HZ}}}" for name in ("all", "part")]
    settings = [*declared, "smoother.engine=none", *overrides]
    tracker = Tracker(load_config("default", settings), image=(1280, 720))
    reported = []
    false = rng.uniform((0, 0), (1240, 660), (ghosts, 2))
    for k in range(int(SECONDS * RATE_HZ)):
        t = k / RATE_HZ
        phase = (60.0 * t + 310.0 * np.arange(len(LANES))) % 2400.0
        x = 20.0 + np.minimum(phase, 2400.0 - phase)
        walkers = np.stack([x, LANES, np.full_like(x, 25.0), np.full_like(x, 60.0)], axis=1)
        if k % 10 == 0:
            false = rng.uniform((0, 0), (1240, 660), (ghosts, 2))
        things = np.concatenate(
            [walkers, np.concatenate([false, np.tile([25.0, 60.0], (ghosts, 1))], axis=1)]
        )
        scans = []
        for name, found, chance in (("all", things, 0.85), ("part", walkers, 0.9)):
            middle = found[:, 0] + 12.5
            low, high = (0.0, 1280.0) if name == "all" else second
            seen = found[(rng.random(len(found)) < chance) & (low <= middle) & (middle < high)]
            noisy = seen + rng.normal(0.0, 1.0, seen.shape)
            scans.append((t, name, noisy, np.full(len(noisy), 0.8)))
        reported.append(len(tracker.step(scans)))
    return tracker, float(np.mean(reported[len(reported) // 2 :]))


def looks(tracker, sensor, x):
    """Call what `stages.looking.looks_at` calls: a stage has no entry from Python."""
    lifecycle, scene = tracker.config.lifecycle, tracker.snapshot().scene
    s = tracker.sensor_names.index(sensor)
    seen = lifecycle.field_boxes * (scene.field_witnesses[s] - lifecycle.field_doubt)
    return in_field(x, *scene.field[s], seen)


@pytest.mark.parametrize("second", [(640.0, 1280.0), (0.0, 430.0)])
def test_a_camera_that_sees_a_part_takes_nothing_from_one_that_sees_all(second):
    tracker, found = follow(second)
    assert found > 0.9 * len(LANES)
    elsewhere = 1280.0 - second[1] if second[0] == 0.0 else 0.0
    far = 1250.0 if elsewhere else 30.0
    assert looks(tracker, "part", far) < 0.2
    assert looks(tracker, "part", 0.5 * sum(second)) == 1.0
    assert looks(tracker, "all", far) > 0.6


def test_it_did_where_both_were_taken_to_see_all():
    _, found = follow((640.0, 1280.0), ["lifecycle.field_doubt=0"])
    assert found < 0.8 * len(LANES)


def test_where_both_see_all_false_things_are_found_out_all_the_same():
    tracker, found = follow((0.0, 1280.0), ghosts=6)
    assert found < 1.1 * len(LANES)
    trust = dict(zip(tracker.sensor_names, tracker.snapshot().scene.trust, strict=True))
    assert trust["all"] < 0.4 < trust["part"]


def test_one_vehicle_however_long_tells_nothing_of_the_field():
    declared = [f"sensors.{name}={{rate_hz: {RATE_HZ}}}" for name in ("all", "part")]
    tracker = Tracker(load_config("default", [*declared, "smoother.engine=none"]), image=(1280, 720))
    for k in range(300):
        box = [[640.0, 300.0, 25.0, 60.0]]
        tracker.step([(k / RATE_HZ, name, box, [0.8]) for name in ("all", "part")])
    assert looks(tracker, "part", 30.0) == 1.0
