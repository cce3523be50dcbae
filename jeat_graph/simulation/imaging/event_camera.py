"""The event camera over a scene: which tiles are rendered how often, and the events of all pixels."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.events import EventArray
from jeat_graph.simulation.imaging.carla_pixel import (
    CarlaModel,
    CarlaState,
    carla_advance,
    make_carla_model,
    make_carla_state,
)
from jeat_graph.simulation.imaging.config import ImagingConfig
from jeat_graph.simulation.imaging.event_pixel import (
    PixelModel,
    PixelState,
    advance,
    make_model,
    make_state,
    unsettled,
)
from jeat_graph.simulation.imaging.event_sink import Sink, make_sink, to_events, with_room
from jeat_graph.simulation.imaging.lighting import LUMINANCE
from jeat_graph.simulation.imaging.painter import paint_tile
from jeat_graph.simulation.imaging.plan import Plan, who_touches
from jeat_graph.simulation.imaging.renderer import Renderer
from jeat_graph.simulation.imaging.stage import Stage
from jeat_graph.simulation.imaging.tiles import TILE, TILE_H, TILE_W
from jeat_graph.simulation.streams import stream

_SETTLE_STEPS = 8  # of pixels that see nothing move, while their photoreceptors still follow
_FOLLOWING, _SETTLED = 0.01, 1e-6  # ln
_LARGEST_CHANGE = 45.0  # ln of the largest ratio of luminances, with room to spare


class Interval(NamedTuple):
    """What the pixels see within an interval of time.

    Attributes:
        tiles: (T, 2) first row and column of the tiles.
        boxes: (V, 3, 4) what each vehicle changes in the picture (px).
        steps: (T,) how often each tile is painted; 0 where nothing changes.
        times_us: (J + 1,) beginning of the interval and the J times of painting (µs).
        static: (H, W) luminance of the picture without vehicles (cd/m²).
        quiet: (T,) true where a tile's pixels see the static picture and have settled; changed.
    """

    tiles: IntArray
    boxes: FloatArray
    steps: IntArray
    times_us: FloatArray
    static: FloatArray
    quiet: BoolArray


class EventCamera:
    """Makes the events of one scene, interval by interval.

    Attributes:
        rendered: tiles rendered so far.
    """

    def __init__(
        self, renderer: Renderer, config: ImagingConfig, seed: int, segment_seed: int, scale: float
    ) -> None:
        """Start at time 0.

        Args:
            renderer: of the scene.
            config: settings.
            seed: of the camera; its pixels' mismatch is the same for all segments.
            segment_seed: of the segment's noise.
            scale: takes luminance to the linear level of the picture (`carla` mode only).
        """
        self.renderer = renderer
        self.config = config
        height, width = renderer.background.lux.shape
        self._width = width
        self._static = np.ascontiguousarray(renderer.background.whole @ LUMINANCE)
        first = (renderer.picture(0.0) @ LUMINANCE).ravel()
        rng = stream(segment_seed, "evt.noise")
        self._carla = config.evt.mode == "carla"
        self._model: Any
        self._state: Any
        if self._carla:
            self._model = make_carla_model(config.carla, scale, config.rgb.gamma)
            self._state = make_carla_state(self._model, first, rng)
            least = 0.01 if config.carla.sigma_threshold > 0.0 else config.carla.positive_threshold
        else:
            self._model = make_model(config.evt, stream(seed, "evt.mismatch"), width * height)
            self._state = make_state(self._model, first, rng)
            least = float(min(self._model.on.min(), self._model.off.min()))
        self._room = TILE * math.ceil(_LARGEST_CHANGE / least + 100.0)
        self._quiet = np.zeros(len(renderer.tiles), dtype=np.bool_)
        self._now_us = 0
        self._ticks = 0
        self.rendered = 0

    def advance(self, until_us: int) -> EventArray:
        """Return the events from where the call before ended up to `until_us`."""
        if self._carla:
            period = 1e6 / self.config.carla.tick_hz
            last = int(until_us / period + 1e-9)
            if last <= self._ticks:
                return EventArray.empty(labelled=True)
            times_us = period * np.arange(self._ticks, last + 1, dtype=np.float64)
            self._ticks = last
            return self._run(self.renderer.plan(1e-6 * times_us[0], 1e-6 * times_us[-1]), times_us)
        plan = self.renderer.plan(1e-6 * self._now_us, 1e-6 * until_us)
        share = np.arange(plan.most + 1, dtype=np.float64) / plan.most
        times_us = self._now_us + (until_us - self._now_us) * share
        self._now_us = until_us
        return self._run(plan, times_us)

    def _run(self, plan: Plan, times_us: FloatArray) -> EventArray:
        r = self.renderer
        every = None if self._carla else plan.every
        moments = r.moments(1e-6 * times_us[1:], plan.look, every)
        steps = np.where(plan.steps > 0, len(times_us) - 1, 0) if self._carla else plan.steps
        run = _run_carla if self._carla else _run_physical
        work = Interval(r.tiles, plan.boxes, steps, times_us, self._static, self._quiet)
        sink = make_sink(max(1 << 18, 2 * self._room))
        stage = r.stage(moments, plan.look)
        sink, rendered = run(work, stage, self._model, self._state, sink, self._room)
        self.rendered += rendered
        return to_events(sink, self._width)


@njit(cache=True)
def _fill(row0: int, column0: int, static: FloatArray, pixels: IntArray, luminance: FloatArray) -> int:
    """Pixels of a tile and what they see while nothing moves; returns how many there are."""
    height, width = static.shape
    count = 0
    for row in range(row0, min(row0 + TILE_H, height)):
        for column in range(column0, min(column0 + TILE_W, width)):
            pixels[count] = row * width + column
            luminance[count] = static[row, column]
            count += 1
    return count


@njit(cache=True)
def _take(patch: FloatArray, columns: int, count: int, luminance: FloatArray) -> None:
    """Luminance of a rendered tile, in the order of `_fill`."""
    for n in range(count):
        p = n // columns * TILE_W + n % columns
        luminance[n] = 0.2126 * patch[p, 0] + 0.7152 * patch[p, 1] + 0.0722 * patch[p, 2]


@njit(cache=True)
def _run_physical(
    work: Interval, stage: Stage, model: PixelModel, state: PixelState, sink: Sink, room: int
) -> tuple[Sink, int]:
    """Take all pixels through an interval, tile by tile; returns the sink and how many tiles were painted."""
    tiles, boxes, steps, times_us, static, quiet = work
    who = np.zeros((3, max(1, len(boxes))), dtype=np.int64)
    counts = np.zeros(3, dtype=np.int64)
    patch = np.zeros((TILE, 3))
    pixels, luminance = np.zeros(TILE, dtype=np.int64), np.zeros(TILE)
    available = len(times_us) - 1
    start, end = times_us[0], times_us[available]
    rendered = 0
    for n in range(len(tiles)):
        row0, column0 = tiles[n]
        count = _fill(row0, column0, static, pixels, luminance)
        sink = with_room(sink, room)
        if steps[n] == 0:
            pieces = 1
            if not quiet[n]:
                apart = unsettled(pixels[:count], luminance[:count], model, state)
                pieces = _SETTLE_STEPS if apart > _FOLLOWING else 1
                quiet[n] = apart < _SETTLED
            for k in range(pieces):
                a, b = start + (end - start) * k / pieces, start + (end - start) * (k + 1) / pieces
                advance(pixels[:count], luminance[:count], a, b, quiet[n], model, state, sink)
            continue
        quiet[n] = False
        who_touches(row0, column0, boxes, who, counts)
        columns = min(TILE_W, static.shape[1] - column0)
        stride = available // steps[n]
        for k in range(steps[n]):
            j = (k + 1) * stride - 1
            paint_tile(row0, column0, j, who, counts, stage, patch)
            _take(patch, columns, count, luminance)
            sink = with_room(sink, room)
            a, b = times_us[k * stride], times_us[(k + 1) * stride]
            advance(pixels[:count], luminance[:count], a, b, False, model, state, sink)
        rendered += steps[n]
    return sink, rendered


@njit(cache=True)
def _run_carla(
    work: Interval, stage: Stage, model: CarlaModel, state: CarlaState, sink: Sink, room: int
) -> tuple[Sink, int]:
    """Take all pixels from tick to tick, tile by tile; as `_run_physical`."""
    tiles, boxes, steps, times_us, static, _ = work
    who = np.zeros((3, max(1, len(boxes))), dtype=np.int64)
    counts = np.zeros(3, dtype=np.int64)
    patch = np.zeros((TILE, 3))
    pixels, luminance = np.zeros(TILE, dtype=np.int64), np.zeros(TILE)
    rendered = 0
    for n in range(len(tiles)):
        row0, column0 = tiles[n]
        count = _fill(row0, column0, static, pixels, luminance)
        columns = min(TILE_W, static.shape[1] - column0)
        who_touches(row0, column0, boxes, who, counts)
        for j in range(len(times_us) - 1):
            sink = with_room(sink, room)
            if steps[n] > 0:
                paint_tile(row0, column0, j, who, counts, stage, patch)
                _take(patch, columns, count, luminance)
                rendered += 1
            carla_advance(pixels[:count], luminance[:count], times_us[j], times_us[j + 1], model, state, sink)
    return sink, rendered
