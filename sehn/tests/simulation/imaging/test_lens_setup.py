"""What is set up once a segment, against its plain form: to the byte, for recordings depend on it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from jeat_graph_sehn.simulation.imaging import background, lens_events
from jeat_graph_sehn.simulation.imaging.lens import Lens, straighten
from jeat_graph_sehn.simulation.imaging.lens_config import LensConfig
from jeat_graph_sehn.simulation.imaging.lighting import LUMINANCE
from jeat_graph_sehn.simulation.imaging.renderer import Renderer
from jeat_graph_sehn.simulation.imaging.source import RenderedSource
from jeat_graph_sehn.simulation.imaging.tiles import TILE_H, TILE_W, tile_raster
from jeat_graph_sehn.simulation.scenario import load_scenario


@pytest.mark.parametrize(("k1", "k2"), [(0.0, 0.0), (-0.3, 0.0), (-0.2, 0.03), (0.12, 0.0)])
def test_newtons_method_that_ends_early_ends_where_thirty_steps_do(k1: float, k2: float) -> None:
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 81), np.linspace(-0.35, 0.35, 55))
    bent = np.stack([x, y], axis=-1)
    target = np.sqrt((bent**2).sum(axis=-1, keepdims=True))
    r = target.copy()
    for _ in range(30):
        gain, slope = 1.0 + k1 * r**2 + k2 * r**4, 1.0 + 3.0 * k1 * r**2 + 5.0 * k2 * r**4
        r = r - (r * gain - target) / slope
    plain = np.where(target > 1e-12, bent * (r / np.maximum(target, 1e-12)), bent)
    assert np.array_equal(straighten(bent, LensConfig(k1=k1, k2=k2)), plain)


@pytest.mark.parametrize("width", [160, 100])
def test_what_tiles_look_at_is_what_their_pixels_do(width: int) -> None:
    source = RenderedSource(load_scenario("day"))
    camera = replace(source.camera, width=width, height=91)
    lens = Lens(LensConfig(k1=-0.15, sway_deg=0.05), camera, np.random.default_rng(3))
    tiles = tile_raster(camera.width, camera.height)
    places = lens_events._places(lens)
    middle, spread = lens_events._spread(lens, tiles, places)
    reach = lens_events._reach(lens, places)
    focal = np.array([lens.canvas.fx, lens.canvas.fy])
    place = lens.rays * focal + np.array([lens.canvas.cx, lens.canvas.cy])
    for n, (row, column) in enumerate(tiles.tolist()):
        part = place[row : row + TILE_H, column : column + TILE_W].reshape(-1, 2)
        at = min(row + TILE_H // 2, camera.height - 1), min(column + TILE_W // 2, camera.width - 1)
        assert np.array_equal(middle[n], lens.rays[at])
        low, high = part.min(axis=0) - place[at], part.max(axis=0) - place[at]
        np.testing.assert_allclose(spread[n], [low[1], high[1], low[0], high[0]], atol=1e-9)
        # Whatever the mount does, pixels look within the reach.
        assert reach[n, 0] * TILE_H <= max(part[:, 1].min(), 0.0)
        assert (reach[n, 1] + 1) * TILE_H >= min(part[:, 1].max(), lens.canvas.height)
        assert reach[n, 2] * TILE_W <= max(part[:, 0].min(), 0.0)
        assert (reach[n, 3] + 1) * TILE_W >= min(part[:, 0].max(), lens.canvas.width)


def test_the_packed_picture_has_each_layer_in_its_place() -> None:
    source = RenderedSource(load_scenario("night"))
    render = replace(source.imaging.render, width=80, height=48)
    source = RenderedSource(load_scenario("night"), replace(source.imaging, render=render))
    renderer = Renderer(source.scene(0), render, 1)
    b, lights = renderer.background, renderer.lights
    for channels in (1, 3):
        packed = background.pack(b, lights, renderer.view, channels)
        assert packed.shape == (48, 80, background.PACKED + 5 * channels)
        assert packed.flags.c_contiguous
        assert np.array_equal(packed[..., background.LUX], b.lux)
        assert np.array_equal(packed[..., background.PLACE : background.PLACE + 2], b.place)
        assert np.array_equal(packed[..., background.COVER], b.front_cover)
        assert np.array_equal(packed[..., background.DEPTH], b.front_depth)
        assert np.array_equal(packed[..., background.GAIN], b.gain)
        back = b.back if channels == 3 else (b.back @ LUMINANCE)[..., None]
        glow = b.glow if channels == 3 else (b.glow @ LUMINANCE)[..., None]
        assert np.array_equal(packed[..., background.PACKED : background.PACKED + channels], back)
        assert np.array_equal(packed[..., -channels:], glow)
