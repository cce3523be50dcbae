"""Indicators: the side to which a vehicle goes, in time, at their rate."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph_sehn.simulation.world.paths import Paths
from jeat_graph_sehn.simulation.world.signals import LEAD_S, blink, turning


def paths(shift: float) -> Paths:
    """Two vehicles, of which the second changes lane from 10 s on, in 4 s."""
    none = np.zeros((1, 2, 4))
    one = np.array([1]), np.array([10.0]), np.array([4.0]), np.array([shift])
    return Paths(0.0, 1.0, none, np.zeros(2), *one, np.zeros((2, 3)))


@pytest.mark.parametrize(
    ("shift", "facing", "side"), [(3.5, 1, 1), (-3.5, 1, 0), (3.5, -1, 0), (-3.5, -1, 1)]
)
def test_who_changes_lane_signals_to_its_own_side_from_two_seconds_before(shift, facing, side):
    times = np.array([10.0 - LEAD_S - 0.1, 10.0 - LEAD_S + 0.1, 11.9, 12.1])
    on = turning(paths(shift), np.full(2, float(facing)), times)
    assert on[:, 1, side].tolist() == [False, True, True, False]
    assert not on[:, 0].any()
    assert not on[:, 1, 1 - side].any()


def test_indicators_flash_at_their_rate_half_of_the_time():
    times = np.arange(0.0, 20.0, 0.001)
    level = blink(times, np.array([1.5, 1.0]), np.array([0.0, 0.3]))
    assert level.min() == 0.0
    assert level.max() == 1.0
    for column, rate in zip(level.T, (1.5, 1.0), strict=True):
        strength = np.abs(np.fft.rfft(column - column.mean()))
        assert np.argmax(strength) / 20.0 == pytest.approx(rate)
        # Half of the period, less what it takes to come on.
        assert column.mean() == pytest.approx(0.5 - 0.03 * rate, abs=1e-3)
