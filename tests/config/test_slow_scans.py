"""Scans that come seldom: what one expects to move between two of them is bounded."""

from __future__ import annotations

from dataclasses import replace

import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.config.slow_scans import for_slow_scans


def at(rate_hz, *overrides):
    config = load_config("default", overrides)
    return replace(config, sensors={"cam": replace(config.sensors["rgb"], rate_hz=rate_hz)})


@pytest.mark.parametrize("rate_hz", [5.0, 10.0, 100.0])
def test_from_five_scans_a_second_on_nothing_changes(rate_hz):
    assert for_slow_scans(at(rate_hz)) == at(rate_hz)


@pytest.mark.parametrize("rate_hz", [0.2, 1.0, 2.0])
def test_from_one_scan_to_the_next_a_new_track_moves_by_about_its_length(rate_hz):
    slow, period_s = for_slow_scans(at(rate_hz)), 1.0 / rate_hz
    motion = slow.motion
    moved = motion.velocity_std_per_size * period_s
    assert 0.5 < moved < 1.0 if rate_hz > 1.5 else 1.0 < moved < 2.0
    assert 0.5 * motion.acceleration_std_per_size * period_s**2 < 0.2
    # White noise in the jerk: variance q² T⁵ / 20 of the position.
    assert motion.jerk_per_size * (period_s**5 / 20.0) ** 0.5 < 0.1
    assert slow.size.rate_std * period_s <= 0.35
    assert slow.lifecycle.max_gap_tentative_s > period_s
    assert slow.lifecycle.max_gap_confirmed_s >= 2.0 * period_s


def test_it_is_bounded_once_and_the_fastest_sensor_counts():
    slow = for_slow_scans(at(1.0))
    assert for_slow_scans(slow) == slow
    both = replace(
        at(1.0), sensors={**at(1.0).sensors, "fast": replace(at(1.0).sensors["cam"], rate_hz=20.0)}
    )
    assert for_slow_scans(both) == both


def test_what_is_set_narrower_stays():
    slow = for_slow_scans(at(1.0, "motion.velocity_std_per_size=0.1", "lifecycle.max_gap_confirmed_s=60"))
    assert slow.motion.velocity_std_per_size == 0.1
    assert slow.lifecycle.max_gap_confirmed_s == 60.0
