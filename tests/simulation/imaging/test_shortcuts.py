"""Shortcuts of the renderer against what they stand for."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.simulation.imaging.config import EventCameraConfig
from jeat_graph.simulation.imaging.event_pixel import make_model, most_share, shot_share
from jeat_graph.simulation.imaging.event_run import between
from jeat_graph.simulation.imaging.lighting import LAMP_HEIGHT_M, beam_candela
from jeat_graph.simulation.imaging.optics import Optics, glow_at
from jeat_graph.simulation.imaging.road_light import beams_at


def test_glow_by_roots_is_the_power_of_its_model() -> None:
    optics = Optics(share=0.08, core_px=3.2, reach_px=38.4, scale=0.01)
    for r2 in np.linspace(0.0, 38.4**2, 500, endpoint=False):
        model = 0.01 * (1.0 + r2 / 3.2**2) ** -1.25 * (1.0 - r2 / 38.4**2) ** 2
        assert glow_at(float(r2), optics) == pytest.approx(model, rel=1e-12, abs=1e-18)


@pytest.mark.parametrize("power", [0.5, 1.0, 1.25, 3.0])
def test_no_share_of_shot_noise_exceeds_its_bound(power: float) -> None:
    config = EventCameraConfig(shot_power=power, shot_bright_factor=0.1)
    model = make_model(config, np.random.default_rng(0), 1)
    for luminance in np.geomspace(1e-4, 1e5, 400):
        assert shot_share(float(luminance), model) <= most_share(float(luminance), model)


def test_light_between_two_keys_is_on_a_straight_line() -> None:
    keys, light = np.random.default_rng(0).random((4, 64, 3)), np.zeros((64, 3))
    between(keys, 1, 0.25, light)
    assert np.allclose(light, 0.75 * keys[1] + 0.25 * keys[2], rtol=1e-14)


def test_beams_on_many_places_are_those_on_each() -> None:
    rng = np.random.default_rng(0)
    place = np.ascontiguousarray(rng.uniform(-60.0, 60.0, (2, 61)))
    sin, cos, limit, out = 0.6, 0.8, 50.0, np.zeros(61)
    beams_at(place, (1.0, 2.0, sin, cos), (0.5, limit**2, 14000.0, 0.02), out)
    lit = 0
    for n, (x, y) in enumerate(place.T):
        dx, dy = float(x) - 1.0, float(y) - 2.0
        forward, r2 = dx * sin + dy * cos, dx * dx + dy * dy + LAMP_HEIGHT_M**2
        lux = 0.0
        if forward > 0.05 and r2 < limit**2:
            candela = beam_candela(forward, dx * cos - dy * sin, -LAMP_HEIGHT_M, 14000.0, 0.02)
            lux = 0.5 * candela * LAMP_HEIGHT_M / (r2 + 0.3) ** 1.5 * (1.0 - r2 / limit**2) ** 2
            lit += 1
        assert out[n] == pytest.approx(lux, rel=1e-12)
    assert 5 < lit < 55
