"""Columns and units of time are recognised by the data, or left to the user; never guessed wrongly."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from jeat_graph.data.errors import ConfigError
from jeat_graph.io.events.layout import EventLayout, orders_of, role_of, unit_of

PER_SECOND = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}


def events(count: int, rate_hz: float, size: tuple[int, int], seed: int, start_s: float = 0.0):
    """Times in whole µs, columns, rows and polarity of `count` events."""
    rng = np.random.default_rng(seed)
    t_us = np.sort(rng.integers(0, max(int(1e6 * count / rate_hz), 1), count)) + int(start_s * 1e6)
    return t_us, rng.integers(0, size[0], count), rng.integers(0, size[1], count), rng.integers(0, 2, count)


cameras = st.sampled_from([(346, 260), (640, 480), (1280, 720)])


@given(
    order=st.sampled_from(["txyp", "xypt", "xytp", "ptxy", "tpxy"]),
    size=cameras,
    signed=st.booleans(),
    seconds=st.booleans(),
    start_s=st.floats(0.0, 1000.0),
    seed=st.integers(0, 1000),
)
def test_the_order_of_a_recording_is_always_told(order, size, signed, seconds, start_s, seed):
    t, x, y, p = events(2000, 2e5, size, seed, start_s)
    by_role = {"t": t / 1e6 if seconds else t, "x": x, "y": y, "p": np.where(p, 1, -1) if signed else p}
    assert orders_of([by_role[role] for role in order]) == [order]


def test_an_order_that_the_data_leave_open_is_not_guessed():
    """Rows that ascend beside times: either could be the other."""
    count = np.arange(200)
    both = orders_of([count, count % 7, count, count % 2])
    assert len(both) > 1


def test_columns_that_are_no_events_have_no_order():
    rng = np.random.default_rng(0)
    assert orders_of([rng.random(100), rng.random(100), rng.random(100), rng.random(100)]) == []
    t, _, y, p = events(100, 2e5, (640, 480), 0)
    assert orders_of([t, np.full(100, "left"), y, p]) == []
    assert orders_of([t[:0], y[:0], y[:0], p[:0]]) == []


@given(
    size=cameras,
    hz_px=st.floats(0.25, 18.0),
    unit=st.sampled_from(["s", "us", "ns"]),
    start_s=st.sampled_from([0.0, 2.0, 900.0, 1.7e9]),
    seed=st.integers(0, 1000),
)
def test_the_unit_of_a_usual_recording_is_told(size, hz_px, unit, start_s, seed):
    t_us, x, y, _ = events(3000, hz_px * size[0] * size[1], size, seed, start_s)
    t = {"s": t_us / 1e6, "us": t_us, "ns": t_us * 1000}[unit]
    assert unit_of(t, x, y) == unit


@example(size=(1280, 720), hz_px=407.0, unit="ms", seed=0)
@example(size=(1280, 720), hz_px=326.0, unit="ns", seed=0)
@given(
    size=cameras,
    hz_px=st.floats(1e-4, 450.0),
    unit=st.sampled_from(["s", "ms", "us", "ns"]),
    seed=st.integers(0, 1000),
)
def test_a_recording_of_a_camera_is_never_taken_for_another_unit(size, hz_px, unit, seed):
    """However quiet or busy: right or not guessed. Cameras' clocks count µs."""
    t_us, x, y, _ = events(3000, hz_px * size[0] * size[1], size, seed)
    t = {"s": t_us / 1e6, "ms": t_us / 1e3, "us": t_us, "ns": t_us * 1000}[unit]
    assert unit_of(t, x, y) in (unit, None)


@pytest.mark.parametrize("hz_px", [0.05, 0.2, 0.4])
def test_times_that_a_simulator_steps_by_milliseconds_are_left_to_the_user(hz_px):
    """In µs they could be those of a busy camera in ns."""
    t_us, x, y, _ = events(20_000, hz_px * 640 * 480, (640, 480), 0)
    assert unit_of(t_us // 1000 * 1000, x, y) is None
    assert unit_of(t_us // 1000 * 1000, x, y, "us") == "us"


@pytest.mark.parametrize("hz_px", [0.03, 1.0, 15.0])
def test_thousandths_are_milliseconds_where_as_seconds_they_would_be_far_too_slow(hz_px):
    t_us, x, y, _ = events(20_000, hz_px * 640 * 480, (640, 480), 0)
    assert unit_of(t_us / 1e3, x, y) == "ms"


@pytest.mark.parametrize("hz_px", [1.0, 400.0])
def test_thousandths_are_seconds_where_as_milliseconds_they_would_be_far_too_fast(hz_px):
    t_us, x, y, _ = events(20_000, hz_px * 64 * 64, (64, 64), 0)
    assert unit_of(t_us // 1000 / 1e3, x, y) == "s"


@pytest.mark.parametrize("hz_px", [0.03, 400.0])
def test_nanoseconds_that_the_layout_stands_for_are_believed_at_every_rate_of_a_camera(hz_px):
    t_us, x, y, _ = events(20_000, hz_px * 640 * 480, (640, 480), 0)
    assert unit_of(t_us * 1000, x, y, "ns") == "ns"


def test_whole_milliseconds_of_a_busy_camera_are_not_taken_for_microseconds():
    t_us, x, y, _ = events(200_000, 1.0 * 640 * 480, (640, 480), 0)
    assert unit_of(t_us // 1000, x, y) is None


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("t", ("t", None)),
        ("ts", ("t", None)),
        ("Timestamp", ("t", None)),
        ("timestamp_us", ("t", "us")),
        ("time [ns]", ("t", "ns")),
        ("t(s)", ("t", "s")),
        (' "x" ', ("x", None)),
        ("xs", ("x", None)),
        ("pol", ("p", None)),
        ("polarity", ("p", None)),
        ("times_table", None),
        ("left", None),
    ],
)
def test_names_of_columns(name, expected):
    assert role_of(name) == expected


@pytest.mark.parametrize("columns", [("t", "x", "y"), ("t", "x", "y", "p", "p"), ("t", "x", "y", "polarity")])
def test_columns_that_are_said_wrongly(columns):
    with pytest.raises(ConfigError, match="must be t, x, y and p once each"):
        EventLayout(columns=columns)


def test_a_unit_that_is_none():
    with pytest.raises(ConfigError, match="must be s, ms, us, ns, not minutes"):
        EventLayout(time_unit="minutes")
