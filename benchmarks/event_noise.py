"""Measures the noise of CARLA's event sensor, and what the paper's three remedies do against it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.events import EventArray
from jeat_graph_sehn.simulation.imaging.carla_pixel import carla_advance, make_carla_model, make_carla_state
from jeat_graph_sehn.simulation.imaging.config import CarlaEventConfig, ImagingConfig
from jeat_graph_sehn.simulation.imaging.event_sink import make_sink, to_events
from jeat_graph_sehn.simulation.imaging.lighting import LUMINANCE
from jeat_graph_sehn.simulation.imaging.renderer import Renderer
from jeat_graph_sehn.simulation.imaging.rgb_camera import choose_exposure
from jeat_graph_sehn.simulation.imaging.source import RenderedSource
from jeat_graph_sehn.simulation.scenario import load_scenario
from jeat_graph_sehn.simulation.streams import stream

BASELINE = "baseline"
ALL = "all three"
_IDEAL = "ideal"
_MEASURES: dict[str, dict[str, Any]] = {
    "σ_C = 0": {"sigma_threshold": 0.0},
    "refractory 10 µs": {"refractory_period_ns": 10_000},
    "ε = 0.01": {"log_eps": 0.01},
}
_EVENTS_PER_PIXEL = 64  # and tick, for which there is room; ln(255 / ε) over a threshold is about 40


def measures(config: CarlaEventConfig) -> dict[str, CarlaEventConfig]:
    """The sensor as it was, with each measure alone, and with all of them (paper, section on noise)."""
    every = {key: value for change in _MEASURES.values() for key, value in change.items()}
    rows = {BASELINE: config, **{name: replace(config, **change) for name, change in _MEASURES.items()}}
    return {**rows, ALL: replace(config, **every)}


def measure_noise(job: tuple[str, int, int, ImagingConfig]) -> list[dict[str, Any]]:
    """Let the sensor look at one segment, once with each row's settings and the same pictures.

    Args:
        job: scenario, seed, number of ticks, settings.

    Returns:
        One record a row: rates of noise and motion events a pixel (Hz); the share of the baseline's motion
        events that are kept, by count and one by one (see `matched`); and the share that is found of those
        of an ideal sensor, which is the baseline without flicker and with steady thresholds.
    """
    name, seed, ticks, imaging = job
    made = RenderedSource(load_scenario(name), imaging, seed=seed, frames=max(1, round(ticks / 5)))
    renderer = Renderer(made.scene(0), imaging.render, seed)
    scale = choose_exposure(imaging.rgb, renderer.background.whole).scale(imaging.rgb)
    rows = measures(imaging.carla)
    rows[_IDEAL] = replace(imaging.carla, sigma_threshold=0.0, render_noise_dn=0.0)
    models = {row: make_carla_model(config, scale, imaging.rgb.gamma) for row, config in rows.items()}
    period = 1e6 / imaging.carla.tick_hz
    parts: dict[str, list[EventArray]] = {row: [] for row in rows}
    first = _luminance(renderer, 0.0)
    states = {row: make_carla_state(models[row], first, stream(seed, "evt.noise")) for row in rows}
    pixels = np.arange(len(first))
    for k in range(1, ticks + 1):
        seen = _luminance(renderer, 1e-6 * period * k)
        for row in rows:
            sink = make_sink(_EVENTS_PER_PIXEL * len(first))
            carla_advance(pixels, seen, period * (k - 1), period * k, models[row], states[row], sink)
            parts[row].append(to_events(sink, made.size_px[0]))
    events = {row: EventArray.concatenate(part) for row, part in parts.items()}
    span = len(first) * ticks * period * 1e-6
    ideal = events.pop(_IDEAL)
    return [
        {"scenario": name, "seed": seed, "row": row, **_judge(found, events[BASELINE], ideal, span, period)}
        for row, found in events.items()
    ]


def _luminance(renderer: Renderer, time_s: float) -> FloatArray:
    out: FloatArray = (renderer.picture(time_s) @ LUMINANCE).ravel()
    return out


def _judge(
    events: EventArray, baseline: EventArray, ideal: EventArray, span: float, period_us: float
) -> dict[str, float]:
    assert events.by_motion is not None
    assert baseline.by_motion is not None
    motion, before = events.take(events.by_motion), baseline.take(baseline.by_motion)
    return {
        "noise_hz": (len(events) - len(motion)) / span,
        "motion_hz": len(motion) / span,
        "kept": len(motion) / max(len(before), 1),
        "matched": matched(motion, before, period_us),
        "ideal": matched(motion, ideal, period_us),
    }


def matched(events: EventArray, reference: EventArray, window_us: float) -> float:
    """Share of the reference's events with one of `events` at the same pixel, of the same polarity, in time.

    Args:
        events: what is judged.
        reference: what should be found in it.
        window_us: how far off in time counts as found (µs).
    """
    if not len(reference):
        return float("nan")
    if not len(events):
        return 0.0
    keys = [_key(a) for a in (events, reference)]
    have = np.sort(keys[0])
    at = np.searchsorted(have, keys[1] - int(window_us))
    found = have[np.minimum(at, len(have) - 1)]
    return float(np.mean((at < len(have)) & (found <= keys[1] + int(window_us))))


def _key(events: EventArray) -> IntArray:
    """One number an event that sorts by pixel, polarity and time (µs, below 268 s)."""
    pixel = (
        events.y.astype(np.int64) << 20 | events.x.astype(np.int64) << 1 | events.polarity.astype(np.int64)
    )
    return pixel << 28 | events.t_us
