from __future__ import annotations

import math

import numpy as np
import pytest

from jeat_graph.data.events import EventArray
from jeat_graph_sehn.simulation.imaging.carla_pixel import carla_advance, make_carla_model, make_carla_state
from jeat_graph_sehn.simulation.imaging.config import CarlaEventConfig
from jeat_graph_sehn.simulation.imaging.event_sink import make_sink, to_events

TICK_US = 10_000.0


def run(luminance: np.ndarray, **config: float) -> EventArray:
    """Events of N pixels at ticks with a linear level `luminance` (T, N) and gamma 1."""
    rng = np.random.default_rng(0)
    model = make_carla_model(CarlaEventConfig(**config), 1.0, 1.0)  # type: ignore[arg-type]
    state = make_carla_state(model, luminance[0], rng)
    sink = make_sink(1_000_000)
    pixels = np.arange(luminance.shape[1])
    for k in range(1, len(luminance)):
        carla_advance(
            pixels, np.ascontiguousarray(luminance[k]), TICK_US * (k - 1), TICK_US * k, model, state, sink
        )
    return to_events(sink, luminance.shape[1])


def rule(levels: np.ndarray, threshold: float, epsilon: float, dead_us: float) -> list[tuple[float, int]]:
    """ESIM's rule for one pixel of an 8-bit picture, written down plainly."""
    values = np.log(epsilon + np.floor(255.0 * levels + 0.5) / 255.0)
    reference, stamp, out = values[0], None, []
    for k in range(1, len(values)):
        before, now = values[k - 1], values[k]
        sign = 1 if now >= before else -1
        while True:
            level = reference + sign * threshold
            if sign * level <= sign * before or sign * level > sign * now:
                break
            t = TICK_US * (k - 1) + TICK_US * (level - before) / (now - before)
            if stamp is None or t - stamp >= dead_us:
                out.append((t, int(sign > 0)))
                stamp = t
            reference = level
    return out


@pytest.mark.parametrize("dead_ns", [0, 3_000_000])
def test_events_are_those_of_the_rule(dead_ns: int) -> None:
    rng = np.random.default_rng(3)
    levels = np.clip(np.cumsum(rng.normal(0.0, 0.03, (60, 40)), axis=0) + 0.1, 0.0, 1.0)
    quiet = {"sigma_threshold": 0.0, "render_noise_dn": 0.0, "refractory_period_ns": dead_ns}
    events = run(levels, **quiet)
    count = 0
    for x in range(40):
        expected = rule(levels[:, x], 0.3, 0.001, 1e-3 * dead_ns)
        got = events.x == x
        np.testing.assert_allclose(events.t_us[got], [t for t, _ in expected], atol=0.51)
        np.testing.assert_array_equal(events.polarity[got], [p for _, p in expected])
        count += len(expected)
    assert count > 200


def test_a_static_picture_without_noise_makes_no_event() -> None:
    levels = np.tile(np.linspace(0.0, 1.0, 300), (50, 1))
    assert len(run(levels, sigma_threshold=0.1, render_noise_dn=0.0)) == 0


def test_flicker_of_a_dark_picture_is_noise_and_a_larger_epsilon_quenches_it() -> None:
    levels = np.full((100, 500), 1.5 / 255.0)
    small = run(levels, sigma_threshold=0.0, log_eps=0.001, render_noise_dn=0.3)
    large = run(levels, sigma_threshold=0.0, log_eps=0.01, render_noise_dn=0.3)
    assert small.by_motion is not None
    assert not small.by_motion.any()
    # One step, from 1 to 2, changes ln(ε + I/255) by 0.59, or by 0.25: above the threshold, or below it.
    assert (
        math.log((0.001 + 2 / 255) / (0.001 + 1 / 255)) > 0.3 > math.log((0.01 + 2 / 255) / (0.01 + 1 / 255))
    )
    assert len(small) > 5000
    assert len(large) < 0.05 * len(small)


def test_redrawn_thresholds_have_the_floor_of_the_sensor() -> None:
    rng = np.random.default_rng(0)
    levels = np.clip(0.5 + np.cumsum(rng.normal(0.0, 0.002, (200, 200)), axis=0), 0.2, 0.8)
    steady = run(levels, sigma_threshold=0.0, render_noise_dn=0.0)
    redrawn = run(levels, sigma_threshold=0.3, render_noise_dn=0.0)
    assert len(redrawn) > 2 * len(steady)


def test_motion_is_labelled_as_motion() -> None:
    levels = np.linspace(0.05, 0.9, 80)[:, None] * np.ones(50)
    events = run(levels, sigma_threshold=0.0, render_noise_dn=0.3)
    assert events.by_motion is not None
    assert events.by_motion.mean() > 0.99
    assert abs(len(events) - 50 * math.floor(math.log(18.0 * 0.9997) / 0.3)) <= 50
