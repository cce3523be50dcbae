"""Shortcuts of the renderer against what they stand for."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.imaging.background import COVER
from jeat_graph_sehn.simulation.imaging.config import EventCameraConfig, RenderConfig
from jeat_graph_sehn.simulation.imaging.event_pixel import make_model, most_share, shot_share
from jeat_graph_sehn.simulation.imaging.event_run import between
from jeat_graph_sehn.simulation.imaging.layers import make_canvas
from jeat_graph_sehn.simulation.imaging.lighting import LAMP_HEIGHT_M, beam_candela
from jeat_graph_sehn.simulation.imaging.optics import Optics, glow_at
from jeat_graph_sehn.simulation.imaging.painter import compose, paint_light
from jeat_graph_sehn.simulation.imaging.renderer import Renderer
from jeat_graph_sehn.simulation.imaging.road_light import beams_at
from jeat_graph_sehn.simulation.imaging.source import RenderedSource
from jeat_graph_sehn.simulation.imaging.tiles import Tile
from jeat_graph_sehn.simulation.scenario import load_scenario

from .scenes import small


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


@pytest.mark.parametrize("channels", [1, 3])
def test_a_tile_that_nobody_touches_is_painted_as_all_are(channels: int) -> None:
    rng = np.random.default_rng(0)
    canvas, tile = make_canvas(channels), Tile(16, 24, 8, 7)
    canvas.ground[:] = rng.random(canvas.ground.shape)
    canvas.ground[::3, COVER] = 0.0
    light = rng.random(canvas.light.shape)
    compose(tile, False, np.zeros(17), light, canvas)
    expected = canvas.out.copy()
    canvas.out[:] = 0.0
    paint_light(tile, light, canvas.ground, canvas.out)
    assert np.array_equal(canvas.out, expected)
    assert expected.any()


def blocks(name: str, step_px: float) -> tuple[FloatArray, int]:
    """Events in 50 ms by frame, polarity and block of 4x4 px, and how many there are in all."""
    source = RenderedSource(
        load_scenario(name), small({"render": {"max_step_px": step_px}}, 320, 192), 5, 6, sensors="events"
    )
    out, count = [], 0
    for step in source.segment(0):
        events = step.events.take(step.events.t_us > step.t_us - 50_000)
        where = (events.polarity.astype(np.int64) * 48 + events.y // 4) * 80 + events.x // 4
        out.append(np.bincount(where, minlength=2 * 48 * 80))
        count += len(step.events)
    return np.array(out, dtype=np.float64), count


@pytest.mark.parametrize("name", ["day", "night-nolight"])
def test_events_of_long_steps_are_those_of_short_ones(name: str) -> None:
    short, few = blocks(name, 1.0)
    long, many = blocks(name, RenderConfig().max_step_px)
    assert np.corrcoef(short.ravel(), long.ravel())[0, 1] > 0.95
    assert many == pytest.approx(few, rel=0.08)


def test_segments_of_one_place_share_its_static_picture() -> None:
    source = RenderedSource(load_scenario("night"), small(), 5, 1)
    alone = [step.rgb for step in RenderedSource(source.scenario, source.imaging, 5, 1).segment(1)]
    first = [step.rgb for step in source.segment(0)]
    after = [step.rgb for step in source.segment(1)]
    assert np.array_equal(after, alone)
    assert not np.array_equal(after, first)
    scene, config = source.scene(1), source.imaging.render
    one = Renderer(scene, config, 1)
    assert Renderer(scene, config, 1, like=one).background is one.background
