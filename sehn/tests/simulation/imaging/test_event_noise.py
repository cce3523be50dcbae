"""The event camera's noise beside what was measured on real ones, within a factor of two."""

from __future__ import annotations

import math

import numpy as np
import pytest

from jeat_graph.data.events import EventArray
from jeat_graph_sehn.simulation.imaging.config import load_imaging
from jeat_graph_sehn.simulation.imaging.event_pixel import advance, make_model, make_state
from jeat_graph_sehn.simulation.imaging.event_sink import make_sink, to_events

WIDTH = 500
GREY = 0.18 / math.pi  # cd/m² of a grey wall per lux


def still(sensor: str, luminance: float, pixels: int, seconds: int) -> EventArray:
    """Events of pixels that look at a grey wall."""
    rng = np.random.default_rng(3)
    model = make_model(load_imaging({"evt": {"sensor": sensor}}).evt, rng, pixels)
    seen = np.full(pixels, luminance)
    state = make_state(model, seen, rng)
    sink = make_sink(4_000_000)
    for k in range(seconds):
        advance(np.arange(pixels), seen, np.full(len(seen), 1e6 * k), 1e6 * (k + 1), True, model, state, sink)
    return to_events(sink, WIDTH)


@pytest.mark.parametrize(
    ("sensor", "lux", "low_hz", "high_hz"),
    [
        ("davis346", 50_000.0, 0.0016, 0.0041),
        ("imx636", 300.0, 0.002, 0.002),
        ("iebcs", 3000.0, 0.13, 0.13),
        ("iebcs", 161.0, 0.075, 0.075),
        ("iebcs", 0.1, 11.8, 11.8),
    ],
)
def test_noise_rates_are_those_measured(sensor: str, lux: float, low_hz: float, high_hz: float) -> None:
    pixels, seconds = (2000, 20) if high_hz > 0.01 else (40_000, 20)
    rate = len(still(sensor, lux * GREY, pixels, seconds)) / pixels / seconds
    assert 0.5 * low_hz < rate < 2.0 * high_hz


@pytest.mark.parametrize(
    ("sensor", "lux", "low", "high"),
    [("davis346", 50_000.0, 0.95, 1.0), ("imx636", 300.0, 0.0, 0.45), ("iebcs", 0.1, 0.52, 0.62)],
)
def test_shares_of_brighter_events_are_those_measured(
    sensor: str, lux: float, low: float, high: float
) -> None:
    pixels = 2000 if lux < 1.0 else 40_000
    assert low <= float(still(sensor, lux * GREY, pixels, 20).polarity.mean()) <= high


def test_few_pixels_are_hot_and_none_hotter_than_measured() -> None:
    pixels = 300_000
    for sensor, hottest in (("davis346", 5.0), ("imx636", 10.0), ("iebcs", 300.0)):
        events = still(sensor, 5000.0 if sensor == "davis346" else 17.0, pixels, 5)
        pixel = events.y.astype(np.int64) * WIDTH + events.x
        counts = np.bincount(pixel, minlength=pixels) / 5.0
        assert counts.max() < 1.3 * hottest
        assert (counts > 2.0).mean() < 1e-4
    assert counts.max() > 10.0


def test_an_ideal_camera_has_no_noise() -> None:
    assert len(still("ideal", 1.0, 1000, 10)) == 0


def test_leak_doubles_with_each_eight_degrees_and_grows_with_light() -> None:
    def rate(luminance: float, **tree: float) -> float:
        config = load_imaging({"evt": {"shot_rate_hz": 0.0, "rate_spread_decades": 0.0, **tree}}).evt
        model = make_model(config, np.random.default_rng(0), 10)
        return float((model.table[:, 2] * (1.0 + model.leak_light * luminance) / model.table[:, 0]).mean())

    assert rate(0.0, temperature_c=33.0) == pytest.approx(2.0 * rate(0.0, temperature_c=25.0))
    assert rate(5000.0) == pytest.approx(4.0 * rate(0.0))
