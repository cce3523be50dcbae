"""Light that goes on and off: street lamps on alternating current, LED lamps in pulses, indicators."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph_sehn.simulation.imaging.event_camera import EventCamera
from jeat_graph_sehn.simulation.imaging.lamps import INDICATOR
from jeat_graph_sehn.simulation.imaging.moments import LAMP_FLUX, LAMP_PULSE
from jeat_graph_sehn.simulation.imaging.renderer import Renderer
from jeat_graph_sehn.simulation.imaging.source import RenderedSource
from jeat_graph_sehn.simulation.scenario import load_scenario

from .scenes import DARK, IDEAL, empty_road, renderer_of, small

FRAMES = 2  # with the two periods before the first, 150 ms


def spectrum_peak_hz(t_us: np.ndarray, end_s: float) -> float:
    """Frequency (Hz) at which the events of the last 100 ms come and go most."""
    times = 1e-6 * t_us - (end_s - 0.1)
    counts = np.bincount((times[times >= 0.0] / 0.0005).astype(int), minlength=200)[:200]
    strength = np.abs(np.fft.rfft(counts - counts.mean()))
    return float(np.argmax(strength) * 10.0)


@pytest.mark.parametrize(("rate", "lens"), [(100.0, {}), (120.0, {}), (100.0, {"k1": -0.2})])
def test_flickering_street_lamps_make_events_at_their_rate(rate, lens):
    render = {"lamp_flicker": 0.5, "lamp_flicker_hz": rate}
    made = RenderedSource(
        empty_road("night", 0), small({"render": render, "lens": lens, "evt": IDEAL}), frames=FRAMES
    )
    steps = [*made.segment(0)]
    brighter = np.concatenate([one.events.t_us[one.events.polarity == 1] for one in steps])
    assert spectrum_peak_hz(brighter, 1e-6 * steps[-1].t_us) == rate


def test_steady_lamps_make_none_and_pictures_see_the_mean():
    def made(depth):
        tree = small({"render": {"lamp_flicker": depth}, "evt": IDEAL})
        return next(iter(RenderedSource(empty_road("night", 0), tree, frames=1).segment(0)))

    steady, flickering = made(0.0), made(0.5)
    assert len(steady.events) == 0
    assert len(flickering.events) > 1000
    assert np.array_equal(steady.rgb, flickering.rgb)


def test_led_lamps_in_pulses_make_events_at_their_rate():
    # A car that drives away so slowly that it makes few events of its own; one that stands would brake.
    renderer = renderer_of([(0, 2.0, 25.0, 2.0, 4.4, 1.8, 1.46)], DARK, led_pulse_hz=200.0)
    renderer._appearance = renderer._appearance._replace(led=np.ones(1, dtype=bool))
    camera = EventCamera(renderer, small({"evt": IDEAL}), 0, 0, 1.0)
    t_us = [camera.advance(50_000 * k) for k in (1, 2, 3)]
    brighter = np.concatenate([one.t_us[one.polarity == 1] for one in t_us])
    assert spectrum_peak_hz(brighter, 0.15) == 200.0
    times = np.arange(0.0, 0.1, 1e-4)
    moments = renderer.moments(times, renderer.seen_at(0.0)[0], for_events=True)
    # Pulses have the mean of steady light.
    assert moments.lamp[:, 0, 2, LAMP_PULSE].mean() == pytest.approx(1.0, abs=0.02)
    assert (renderer.moments(times, renderer.seen_at(0.0)[0]).lamp[:, 0, 2, LAMP_PULSE] == 1.0).all()


@pytest.mark.parametrize("light", ["day", "night-nolight"])
def test_indicators_of_varied_worlds_flash_in_amber(light):
    source = RenderedSource(load_scenario(light), small(), seed=3, frames=1, world="varied")
    times = np.arange(0.0, 2.0, 0.02)
    found = 0
    for index in range(6):
        scene, imaging, _ = source._build(index)
        renderer = Renderer(scene, imaging.render, 1, varied=True)
        look = renderer.seen_at(0.0)[0]
        moments = renderer.moments(times, look)
        for v in np.flatnonzero(look.hazard & look.parked):
            for k in np.flatnonzero(look.lamps[v, :, 2] == INDICATOR):
                red, green, blue = moments.lamp[:, v, k, LAMP_FLUX : LAMP_FLUX + 3].T
                if red.max() > 0.0:
                    found += 1
                    assert red.max() > 2.0 * green.max() > 10.0 * blue.max()
                    assert (red == 0.0).mean() == pytest.approx(0.5, abs=0.1)
                    changes = np.count_nonzero(np.diff((red > 0.0).astype(int)) == 1)
                    assert abs(changes - 2.0 * look.blink_hz[v]) <= 1.0
        if found:
            break  # it takes a world or two until somebody is parked so, and another one shows nothing new
    assert found > 0


def test_the_fixed_world_has_no_indicators():
    source = RenderedSource(load_scenario("night"), small(), seed=3, frames=1)
    scene, imaging, _ = source._build(0)
    look = Renderer(scene, imaging.render, 1).seen_at(0.0)[0]
    assert not (look.lamps[..., 2] == INDICATOR).any()
