from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.events import EventArray
from jeat_graph_sehn.simulation.imaging.config import EventCameraConfig
from jeat_graph_sehn.simulation.imaging.event_pixel import advance, make_model, make_state, photoreceptor
from jeat_graph_sehn.simulation.imaging.event_sink import make_sink, to_events

from .scenes import IDEAL, QUIET


def run(
    times_us: np.ndarray,
    luminance: np.ndarray,
    seed: int = 0,
    order: np.ndarray | None = None,
    **config: float,
) -> EventArray:
    """Events of N pixels that see `luminance` (T, N) at `times_us` (T,)."""
    rng = np.random.default_rng(seed)
    count = luminance.shape[1]
    model = make_model(EventCameraConfig(**config), rng, count)  # type: ignore[arg-type]
    state = make_state(model, luminance[0], rng)
    pixels = np.arange(count) if order is None else order
    sink = make_sink(2_000_000)
    for k in range(1, len(times_us)):
        seen = np.ascontiguousarray(luminance[k][pixels])
        since = np.full(len(seen), float(times_us[k - 1]))
        advance(pixels, seen, since, float(times_us[k]), False, model, state, sink)
    return to_events(sink, count)


def bar(low: float, high: float, pixels: int, step: float) -> tuple[np.ndarray, np.ndarray]:
    """A bar 6 px wide that moves by `step` px each 100 µs over a uniform background."""
    shift = np.arange(-7.0, pixels + 1.0, step)
    x = np.arange(pixels)
    cover = np.clip(np.minimum(x + 1, shift[:, None] + 6.0) - np.maximum(x, shift[:, None]), 0.0, 1.0)
    return 100.0 * np.arange(len(shift)), low + (high - low) * cover


@pytest.mark.parametrize("high", [3.0, 25.0, 0.35])
def test_a_bar_gives_each_pixel_the_events_of_the_closed_form(high: float) -> None:
    on, off = 0.2, 0.23
    times, light = bar(1.0, high, 20, 0.125)
    events = run(times, light, **{**IDEAL, "threshold_on": on, "threshold_off": off})
    first, second = (on, off) if high > 1.0 else (off, on)
    entering = math.floor(abs(math.log(high)) / first)
    # The edge that leaves goes back to the background from the last level that was reached.
    leaving = math.floor(entering * first / second)
    for x in range(20):
        polarity = events.polarity[events.x == x]
        assert list(polarity) == [int(high > 1.0)] * entering + [int(high < 1.0)] * leaving


def test_the_bars_events_come_when_the_logarithm_crosses_each_level() -> None:
    times, light = bar(1.0, 25.0, 20, 0.125)
    events = run(times, light, **{**IDEAL, "threshold_on": 0.2, "threshold_off": 0.23})
    levels = 0.2 * np.arange(1, 17)
    for x in range(20):
        rising = light[:, x].argmax() + 1
        expected = np.interp(levels, np.log(light[:rising, x]), times[:rising])
        got = events.t_us[(events.x == x) & (events.polarity == 1)]
        np.testing.assert_allclose(got, expected, atol=0.5)


def test_what_does_not_change_makes_no_event() -> None:
    light = np.tile(np.geomspace(1e-3, 1e4, 50), (200, 1))
    assert len(run(1000.0 * np.arange(200), light, **{**QUIET, "threshold_sigma": 0.03})) == 0


@given(st.lists(st.floats(0.01, 100.0), min_size=2, max_size=20), st.floats(0.05, 0.6))
def test_the_events_add_up_to_the_signal_within_a_threshold(levels: list[float], threshold: float) -> None:
    light = np.array(levels)[:, None]
    times = 1000.0 * np.arange(len(levels))
    config = {**IDEAL, "threshold_on": threshold, "threshold_off": threshold}
    events = run(times, light, **config)
    total = threshold * (2.0 * events.polarity.astype(float) - 1.0).sum()
    assert abs(math.log(levels[-1] / levels[0]) - total) < threshold * (1.0 + 1e-9)


def test_after_an_event_a_pixel_is_blind_for_the_refractory_period() -> None:
    times = 100.0 * np.arange(400)
    light = np.exp(3.0 * np.sin(times[:, None] / 1500.0 + np.arange(30)))
    events = run(times, light, **{**IDEAL, "refractory_s": 0.0007})
    gaps = np.concatenate([np.diff(events.t_us[events.x == x]) for x in range(30)])
    assert gaps.min() >= 699
    assert np.sum(gaps < 1000) > 30


def test_an_endless_ramp_fires_once_a_threshold_and_a_refractory_period() -> None:
    # After the dead time the pixel starts over from where the signal is: period = C / slope + dead time.
    slope, threshold, dead = 5.0, 0.2, 0.004
    times = np.linspace(0.0, 2e6, 3001)
    light = np.exp(slope * 1e-6 * times)[:, None]
    events = run(times, light, **{**IDEAL, "threshold_on": threshold, "refractory_s": dead})
    np.testing.assert_allclose(np.diff(events.t_us), 1e6 * (threshold / slope + dead), atol=1.1)


def test_leak_events_come_at_the_configured_rate() -> None:
    rate, seconds, pixels = 2.0, 20.0, 500
    times = 50_000.0 * np.arange(int(seconds / 0.05) + 1)
    config = {**QUIET, "leak_rate_hz": rate, "threshold_sigma": 0.03, "rate_spread_decades": 0.0}
    config["leak_per_cd_m2"] = 0.0
    events = run(times, np.ones((len(times), pixels)), **{**config, "refractory_s": 0.0})
    expected = rate * seconds * pixels
    assert abs(len(events) - expected) < 4.0 * math.sqrt(expected)
    assert (events.polarity == 1).all()
    assert events.by_motion is not None
    assert not events.by_motion.any()


@pytest.mark.parametrize(("luminance", "factor"), [(1e-6, 1.0), (0.3, 0.625), (1e6, 0.25)])
def test_shot_noise_has_the_configured_rate_and_falls_with_light(luminance: float, factor: float) -> None:
    rate, seconds, pixels = 5.0, 10.0, 800
    times = 50_000.0 * np.arange(int(seconds / 0.05) + 1)
    config = {"leak_rate_hz": 0.0, "shot_rate_hz": rate, "rate_spread_decades": 0.0, "refractory_s": 0.0}
    config |= {"shot_half_luminance": 0.3, "shot_bright_factor": 0.25}
    events = run(times, np.full((len(times), pixels), luminance), **config)
    expected = factor * rate * seconds * pixels
    assert abs(len(events) - expected) < 5.0 * math.sqrt(expected)
    assert abs(float(events.polarity.mean()) - 0.5) < 0.02


def test_the_photoreceptor_answers_a_step_as_a_first_order_low_pass() -> None:
    config = EventCameraConfig(cutoff_max_hz=300.0, cutoff_hz_per_cd_m2=30.0, cutoff_min_hz=10.0)
    model = make_model(config, np.random.default_rng(0), 1)
    for luminance, cutoff in ((0.01, 10.0), (2.0, 60.0), (1e4, 300.0)):
        output = 0.0
        for _ in range(50):
            output = photoreceptor(output, 1.0, 1.0, 100.0, luminance, model)
        assert output == pytest.approx(1.0 - math.exp(-2.0 * math.pi * cutoff * 50 * 100e-6), rel=1e-9)


def test_the_photoreceptor_follows_a_ramp_one_time_constant_behind() -> None:
    model = make_model(EventCameraConfig(cutoff_max_hz=100.0), np.random.default_rng(0), 1)
    output, tau_us = 0.0, 1e6 / (2.0 * math.pi * 100.0)
    for k in range(400):
        output = photoreceptor(output, 0.01 * k, 0.01 * (k + 1), 250.0, 1e6, model)
    assert output == pytest.approx(4.0 - 0.01 / 250.0 * tau_us, rel=1e-9)


def test_events_of_motion_and_of_noise_are_told_apart() -> None:
    times, light = bar(1.0, 8.0, 40, 0.125)
    clean = run(times, light, **{**IDEAL, "threshold_on": 0.2, "threshold_off": 0.2})
    noisy = run(
        times,
        light,
        **{**IDEAL, "shot_rate_hz": 400.0, "shot_half_luminance": 1e6, "rate_spread_decades": 0.0},
    )
    assert clean.by_motion is not None
    assert noisy.by_motion is not None
    assert clean.by_motion.all()
    # Noise may take the place of a motion event, for it starts the count of change anew; it adds few.
    assert 0.85 * len(clean) < noisy.by_motion.sum() <= 1.02 * len(clean)
    assert (~noisy.by_motion).sum() > 50


def test_a_pixels_noise_does_not_depend_on_the_order_of_the_work() -> None:
    times, light = bar(1.0, 8.0, 40, 0.25)
    order = np.random.default_rng(5).permutation(40)
    one = run(times, light, shot_rate_hz=50.0)
    two = run(times, light, order=order, shot_rate_hz=50.0)
    for x in range(40):
        np.testing.assert_array_equal(one.t_us[one.x == x], two.t_us[two.x == x])


def test_thresholds_differ_between_pixels_as_configured() -> None:
    model = make_model(EventCameraConfig(threshold_sigma=0.03), np.random.default_rng(1), 20_000)
    assert model.on.std() == pytest.approx(0.03, rel=0.05)
    assert model.on.mean() == pytest.approx(0.2, abs=0.001)
    assert abs(np.corrcoef(model.on, model.off)[0, 1]) < 0.03
