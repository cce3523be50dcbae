"""Memory does not grow with time: neither the tracker's, nor that of its smoothers."""

import pytest

#: What a process may gain (MiB). A step or a life that left 50 bytes behind each would show as more.
GAIN_MIB = 0.5


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["default", "paper"])
def test_minutes_of_100_hz_input_leave_nothing_behind(measure, preset):
    found = measure("live", preset)
    assert found["born"] > 80, "many tracks were born and ended"
    assert found["memory"][-1] - found["memory"][0] < GAIN_MIB  # over 14,000 steps


@pytest.mark.slow
def test_many_vehicles_that_come_and_go_leave_nothing_behind(measure):
    found = measure("short_tracks")
    assert found["tracks"] == 150
    assert found["left"] == 0
    assert found["memory"][-1] - found["memory"][4] < GAIN_MIB  # over 100 lives of 80 scans


def test_many_short_windows_leave_nothing_behind(measure):
    found = measure("short_windows")
    assert found["memory"][-1] - found["memory"][1] < GAIN_MIB  # over 150 lives
