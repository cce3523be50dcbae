"""How soon the tracker knows how often a sensor finds its vehicles."""

import numpy as np
import pytest

from jeat_graph import Tracker, load_config


def half_found(duration, vehicles=12, rate_hz=20.0):
    """Scans of vehicles that drive side by side, each found in every second scan."""
    for k in range(int(duration * rate_hz)):
        t, number = k / rate_hz, np.arange(k % 2, vehicles, 2)
        left, top = 100.0 + 80.0 * t + 0.0 * number, 20.0 + 55.0 * number
        boxes = np.column_stack([left, top, np.full(len(number), 70.0), np.full(len(number), 40.0)])
        yield t, "rgb", boxes, np.full(len(number), 0.95)


def learnt(duration):
    tracker = Tracker(load_config("default"), image=(1280, 720))
    for scan in half_found(duration):
        tracker.step(scan)
    return tracker.sensor_states()["rgb"].p_detect


def test_within_seconds_it_knows_that_half_are_missed():
    # 60 scans full of tracks, beside an assumption of .9 that counts as ten of them; a memory of 10 s alone
    # would be at .8 then. Looks at tracks that may be hidden count less, so that it stays a little above.
    assert learnt(3.0) == pytest.approx((10 * 0.9 + 60 * 0.5) / 70, abs=0.12)


def test_it_comes_nearer_with_every_second():
    far = [abs(learnt(duration) - 0.5) for duration in (1.0, 2.0, 4.0, 8.0)]
    assert far == sorted(far, reverse=True)
    assert far[-1] < 0.05


def test_it_learns_the_mean_share_of_its_vehicles_that_were_found():
    # Nothing hides, nothing ends, memory has no end: then that mean is all there is, beside what is assumed.
    lifecycle = "{hidden_prior: 0, scene_memory_s: 1e12, delete_existence: 0, max_gap_confirmed_s: 100}"
    tracker = Tracker(
        load_config("default", [f"lifecycle={lifecycle}", "smoother.engine=none"]), image=(1280, 720)
    )
    at = np.stack(np.meshgrid(np.arange(10) * 120.0 + 40.0, np.arange(5) * 130.0 + 40.0), -1).reshape(-1, 2)
    boxes = np.hstack([at, np.full((50, 2), [60.0, 40.0])])
    assumed = tracker.sensor_states()["rgb"].p_detect
    rng, shares = np.random.default_rng(0), []
    confirmed = 0  # by the scan before: those that count
    for k in range(60):
        found = boxes[rng.random(50) < (0.3 if k >= 10 else 1.0)]
        reported = tracker.step((k / 20.0, "rgb", found, np.full(len(found), 0.95)))
        if confirmed == 50:
            shares.append(len(found) / 50.0)
        confirmed = max(confirmed, len(reported))
    assert tracker.num_tracks == 50
    assert len(shares) > 50
    learnt = (10.0 * assumed + np.sum(shares)) / (10.0 + len(shares))
    assert tracker.sensor_states()["rgb"].p_detect == pytest.approx(learnt, abs=1e-9)
