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
