"""The event camera behind a real lens on a swaying mount (see `lens_run`)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import ConfigError
from jeat_graph.data.events import EventArray
from jeat_graph_sehn.simulation.imaging.config import ImagingConfig
from jeat_graph_sehn.simulation.imaging.event_pixel import make_model, make_state
from jeat_graph_sehn.simulation.imaging.event_run import SETTLE_STEPS, coarse_steps, light_all
from jeat_graph_sehn.simulation.imaging.event_sink import make_sink, to_events
from jeat_graph_sehn.simulation.imaging.lamp_flicker import LampFlicker
from jeat_graph_sehn.simulation.imaging.layers import GLOW
from jeat_graph_sehn.simulation.imaging.lens import Lens
from jeat_graph_sehn.simulation.imaging.lens_interval import LensInterval, Pictures, Sight, light_canvas
from jeat_graph_sehn.simulation.imaging.lens_run import run_lens
from jeat_graph_sehn.simulation.imaging.lighting import LUMINANCE
from jeat_graph_sehn.simulation.imaging.renderer import Renderer
from jeat_graph_sehn.simulation.imaging.tiles import TILE, TILE_H, TILE_W, tile_raster
from jeat_graph_sehn.simulation.streams import stream

_SWAY_STEP = 0.5  # the mount turns no farther from one sample to the next than this part of a vehicle's step
_MOST_SWAY_STEPS = 32
_LARGEST_CHANGE = 45.0  # ln of the largest ratio of luminances, with room to spare


class LensEventCamera:
    """Makes the events of one scene behind a lens, interval by interval."""

    def __init__(
        self, renderer: Renderer, lens: Lens, config: ImagingConfig, seed: int, segment_seed: int
    ) -> None:
        """Start at time 0, with pixels that have settled at what they see then.

        Args:
            renderer: of the scene, with the lens's canvas as camera.
            lens: before it.
            config: settings.
            seed: of the camera; its pixels' mismatch is the same for all segments.
            segment_seed: of the segment's noise.

        Raises:
            ConfigError: CARLA's sensor has no lens.
        """
        if config.evt.mode == "carla":
            raise ConfigError("evt.mode: carla has no lens; leave the section `lens` out")
        self.renderer, self.lens = renderer, lens
        height, width = lens.rays.shape[:2]
        self._width = width
        picture = renderer.picture(0.0) @ LUMINANCE
        first = lens.look(picture[..., None], 0.0, 0.0, 0.0).ravel()
        self._model = make_model(config.evt, stream(seed, "evt.mismatch"), width * height)
        self._state = make_state(self._model, first, stream(segment_seed, "evt.noise"))
        least = float(min(self._model.on.min(), self._model.off.min()))
        self._room = TILE * math.ceil(_LARGEST_CHANGE / least + 100.0)
        self._static = np.ascontiguousarray(renderer.background.whole @ LUMINANCE)
        self._sight = _sight(lens, _contrast(self._static, self._model.dark))
        self._busy = np.ones(len(self._sight.tiles), dtype=np.bool_)
        self._seen: tuple[FloatArray, FloatArray] = np.zeros(width * height), np.zeros(width * height)
        self._lamps = LampFlicker(renderer, True, lens)
        self._begin(picture)
        self._now_us = 0

    def advance(self, until_us: int) -> EventArray:
        """Return the events from where the call before ended up to `until_us`."""
        r, start, end = self.renderer, 1e-6 * self._now_us, 1e-6 * until_us
        plan = r.plan(start, end, for_events=True)
        shakes = max(self._shakes(start, end), self._lamps.steps(end - start))
        count = max(plan.most, shakes, SETTLE_STEPS)
        times = self._now_us + (until_us - self._now_us) * np.arange(count + 1, dtype=np.float64) / count
        moments = r.moments(1e-6 * times[1:], plan.look, plan.every * (count // plan.most), for_events=True)
        stage = r.stage(moments, plan, channels=1)
        keys = light_canvas(r.tiles, plan.boxes, plan.lit, stage, self._glowing, self._light)
        maps = self.lens.homography(1e-6 * times)
        work = LensInterval(
            r.tiles,
            plan.boxes,
            plan.steps,
            *keys,
            times,
            maps,
            shakes,
            self._busy,
            *self._seen,
            self._lamps.within(1e-6 * times),
            coarse_steps(r.quick),
        )
        sink = make_sink(max(1 << 18, 2 * self._room))
        sink = run_lens(work, self._pictures, self._sight, stage, self._model, self._state, sink, self._room)
        self._now_us = until_us
        return to_events(sink, self._width)

    def _shakes(self, start: float, end: float) -> int:
        """How often all pixels look from one time to another (s), a power of two."""
        turns = self.lens.sway.angles(np.linspace(start, end, _MOST_SWAY_STEPS + 1)[:, None, None])
        path = self.lens.canvas.fx * np.hypot(*np.diff(turns[:, :2], axis=0).T)
        shakes, most = 1, self.renderer.config.max_step_px * _SWAY_STEP
        while shakes < _MOST_SWAY_STEPS and path.reshape(shakes, -1).sum(axis=1).max() > most:
            shakes *= 2
        return shakes

    def _begin(self, first: FloatArray) -> None:
        """Take picture (H, W) and light that there are at the beginning."""
        r = self.renderer
        self._pictures = Pictures(self._static, first.copy(), first.copy(), first.copy(), first.copy())
        self._glowing = np.zeros(len(r.tiles), dtype=np.bool_)
        self._light = np.zeros((len(r.tiles), TILE, GLOW + 1))
        plan = r.plan(0.0, 0.0)
        stage = r.stage(r.moments(np.zeros(1), plan.look), plan, channels=1)
        light_all(r.tiles, plan.boxes, plan.lit, stage, self._glowing, self._light)


def _contrast(static: FloatArray, dark: float) -> FloatArray:
    """Relative change of luminance between neighbours in a picture (H, W), by rows and columns of tiles."""
    level = np.log(static + dark)
    change = np.zeros_like(level)
    np.maximum(change[:, :-1], np.abs(np.diff(level, axis=1)), out=change[:, :-1])
    np.maximum(change[:-1], np.abs(np.diff(level, axis=0)), out=change[:-1])
    high, wide = -(-level.shape[0] // TILE_H), -(-level.shape[1] // TILE_W)
    padded = np.zeros((high * TILE_H, wide * TILE_W))
    padded[: level.shape[0], : level.shape[1]] = change
    out: FloatArray = padded.reshape(high, TILE_H, wide, TILE_W).max(axis=(1, 3))
    return out


def _sight(lens: Lens, contrast: FloatArray) -> Sight:
    """Where the tiles of pixels look; `contrast` is of the canvas, by its rows and columns of tiles."""
    tiles = tile_raster(lens.rays.shape[1], lens.rays.shape[0])
    places = _places(lens)
    reach = _reach(lens, places)
    across, down = -(-lens.canvas.width // TILE_W), -(-lens.canvas.height // TILE_H)
    seen_by: list[list[int]] = [[] for _ in range(across * down)]
    for s, (top, low, left, right) in enumerate(reach.tolist()):
        for row in range(top, low + 1):
            for column in range(left, right + 1):
                seen_by[row * across + column].append(s)
    first = np.cumsum([0, *(len(those) for those in seen_by)], dtype=np.int64)
    flat = np.array([s for those in seen_by for s in those], dtype=np.int64)
    middle, spread = _spread(lens, tiles, places)
    return Sight(tiles, np.ascontiguousarray(lens.rays), reach, first, flat, middle, spread, contrast)


class _Places(NamedTuple):
    """Places (H, W, 2) on the canvas of the pixels, the mount at rest; least and greatest (T, 2) of tiles."""

    place: FloatArray
    low: FloatArray
    high: FloatArray


def _places(lens: Lens) -> _Places:
    """Where pixels look on the canvas while the mount is at rest."""
    rest = np.array([[lens.canvas.fx, 0.0, lens.canvas.cx], [0.0, lens.canvas.fy, lens.canvas.cy]])
    place = lens.rays @ rest[:, :2].T + rest[:, 2]
    return _Places(place, *_ranges(place))


def _spread(lens: Lens, tiles: IntArray, places: _Places) -> tuple[FloatArray, FloatArray]:
    """`middle` and `spread` of a sight."""
    place, low, high = places
    at = np.minimum(tiles + np.array([TILE_H // 2, TILE_W // 2]), np.array(place.shape[:2]) - 1)
    own = place[at[:, 0], at[:, 1]]
    spread = np.stack([low[:, 1], high[:, 1], low[:, 0], high[:, 0]], axis=1) - own[:, [1, 1, 0, 0]]
    return np.ascontiguousarray(lens.rays[at[:, 0], at[:, 1]]), spread


def _ranges(place: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Least and greatest place (T, 2) of the pixels in each tile, of places (H, W, 2)."""
    rows, columns = np.arange(0, place.shape[0], TILE_H), np.arange(0, place.shape[1], TILE_W)
    low = np.minimum.reduceat(np.minimum.reduceat(place, rows, axis=0), columns, axis=1)
    high = np.maximum.reduceat(np.maximum.reduceat(place, rows, axis=0), columns, axis=1)
    return low.reshape(-1, 2), high.reshape(-1, 2)


def _reach(lens: Lens, places: _Places) -> IntArray:
    """First and last tile of the canvas, by row and column (T, 4), that each tile of pixels may look at."""
    height, width = lens.canvas.height, lens.canvas.width
    turns = lens.sway.most()
    far = 1.0 + float((lens.rays**2).sum(axis=-1).max())
    spare = lens.canvas.fx * (far * float(turns[:2].max()) + math.sqrt(far) * float(turns[2])) + 1.5
    last = np.array([width - 1, height - 1])
    low = np.minimum(np.maximum(np.floor(places.low - spare), 0), last)
    high = np.maximum(np.minimum(np.ceil(places.high + spare), last), low)
    out: IntArray = np.stack(
        [low[:, 1] // TILE_H, high[:, 1] // TILE_H, low[:, 0] // TILE_W, high[:, 0] // TILE_W], axis=1
    ).astype(np.int64)
    return out
