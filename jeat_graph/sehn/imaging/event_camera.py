"""The event camera over a scene: which tiles are rendered how often, and the events of all pixels."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from jeat_graph.arrays import FloatArray, IntArray
from jeat_graph.events import EventArray
from jeat_graph.sehn.imaging.carla_pixel import carla_step, make_carla_model, make_carla_state
from jeat_graph.sehn.imaging.config import ImagingConfig
from jeat_graph.sehn.imaging.event_pixel import make_model, make_state, step
from jeat_graph.sehn.imaging.event_sink import make_sink, to_events, with_room
from jeat_graph.sehn.imaging.lighting import LUMINANCE
from jeat_graph.sehn.imaging.painter import TILE_H, TILE_W, make_layers, paint_tile
from jeat_graph.sehn.imaging.renderer import Renderer, steps_for, tile_steps, who_touches
from jeat_graph.sehn.streams import stream

_SETTLE_STEPS = 8  # of a pixel that sees nothing move, while its photoreceptor still follows
_SETTLED = 0.01
_LARGEST_CHANGE = 45.0  # ln of the largest ratio of luminances, with room to spare


class EventCamera:
    """Makes the events of one scene, interval by interval."""

    def __init__(self, renderer: Renderer, config: ImagingConfig, seed: int, segment_seed: int, scale: float):
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
        self._static = renderer.background.whole @ LUMINANCE
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
        self._room = TILE_H * TILE_W * math.ceil(_LARGEST_CHANGE / least + 100.0)
        self._now_us = 0
        self._ticks = 0
        self._layers = make_layers()
        self.rendered = 0  # tiles so far

    def advance(self, until_us: int) -> EventArray:
        """Return the events from where the call before ended up to `until_us`."""
        if self._carla:
            return self._advance_ticks(until_us)
        start, end = 1e-6 * self._now_us, 1e-6 * until_us
        steps = self.renderer.steps(start, end)
        count = int(steps[:, 1:].max(initial=1))
        times = start + (end - start) * np.arange(1, count + 1) / count
        times_us = self._now_us + (until_us - self._now_us) * np.arange(count + 1) / count
        self._now_us = until_us
        return self._run(times, times_us, steps)

    def _advance_ticks(self, until_us: int) -> EventArray:
        period = 1e6 / self.config.carla.tick_hz
        last = int(until_us / period + 1e-9)
        if last <= self._ticks:
            return EventArray.empty(labelled=True)
        times_us = period * np.arange(self._ticks, last + 1)
        self._ticks = last
        return self._run(1e-6 * times_us[1:], times_us, None)

    def _run(self, times: FloatArray, times_us: FloatArray, steps: IntArray | None) -> EventArray:
        r = self.renderer
        moments, look = r.moments(times)
        default = len(times)
        every = steps_for(np.zeros((0, 3), dtype=np.int64) if steps is None else steps, look.number, default)
        sink = make_sink(max(1 << 18, 2 * self._room))
        run = _run_carla if self._carla else _run_physical
        sink, rendered = run(
            r.tiles, r.touched(moments), every, times_us, self._static, r.background, moments, look, r.lights,
            r.optics, r.view, self._layers, self._model, self._state, sink, self._room,
        )  # fmt: skip
        self.rendered += rendered
        return to_events(sink, self._width)


@njit(cache=True)
def _run_physical(
    tiles, boxes, every, times_us, static, ground, moments, look, lights, optics, view, layers, model, state,
    sink, room,
):  # type: ignore[no-untyped-def]  # fmt: skip
    height, width = static.shape
    who = np.zeros((3, max(1, len(boxes))), dtype=np.int64)
    counts = np.zeros(3, dtype=np.int64)
    patch = np.zeros((TILE_H * TILE_W, 3))
    available = len(times_us) - 1
    start, end = times_us[0], times_us[available]
    rendered = 0
    for n in range(len(tiles)):
        row0, column0 = tiles[n]
        rows, columns = min(TILE_H, height - row0), min(TILE_W, width - column0)
        who_touches(row0, column0, boxes, who, counts)
        sink = with_room(sink, room)
        if counts.sum() == 0:
            for r in range(rows):
                for c in range(columns):
                    i = (row0 + r) * width + column0 + c
                    light = static[row0 + r, column0 + c]
                    pieces = _SETTLE_STEPS if abs(state.signal[i] - state.output[i]) > _SETTLED else 1
                    for k in range(pieces):
                        a = start + (end - start) * k / pieces
                        b = start + (end - start) * (k + 1) / pieces
                        step(i, a, b, light, model, state, sink)
            continue
        count = tile_steps(who, counts, every, available)
        stride = available // count
        for k in range(count):
            j = (k + 1) * stride - 1
            paint_tile(row0, column0, j, who, counts, ground, moments, look, lights, optics, view, layers, patch)
            sink = with_room(sink, room)
            for r in range(rows):
                for c in range(columns):
                    p = r * TILE_W + c
                    light = 0.2126 * patch[p, 0] + 0.7152 * patch[p, 1] + 0.0722 * patch[p, 2]
                    i = (row0 + r) * width + column0 + c
                    step(i, times_us[k * stride], times_us[(k + 1) * stride], light, model, state, sink)
        rendered += count
    return sink, rendered


@njit(cache=True)
def _run_carla(
    tiles, boxes, every, times_us, static, ground, moments, look, lights, optics, view, layers, model, state,
    sink, room,
):  # type: ignore[no-untyped-def]  # fmt: skip
    height, width = static.shape
    who = np.zeros((3, max(1, len(boxes))), dtype=np.int64)
    counts = np.zeros(3, dtype=np.int64)
    patch = np.zeros((TILE_H * TILE_W, 3))
    rendered = 0
    for n in range(len(tiles)):
        row0, column0 = tiles[n]
        rows, columns = min(TILE_H, height - row0), min(TILE_W, width - column0)
        who_touches(row0, column0, boxes, who, counts)
        moving = counts.sum() > 0
        for j in range(len(times_us) - 1):
            sink = with_room(sink, room)
            if moving:
                paint_tile(row0, column0, j, who, counts, ground, moments, look, lights, optics, view, layers,
                           patch)  # fmt: skip
                rendered += 1
            for r in range(rows):
                for c in range(columns):
                    p = r * TILE_W + c
                    light = static[row0 + r, column0 + c]
                    if moving:
                        light = 0.2126 * patch[p, 0] + 0.7152 * patch[p, 1] + 0.0722 * patch[p, 2]
                    i = (row0 + r) * width + column0 + c
                    carla_step(i, times_us[j], times_us[j + 1], light, model, state, sink)
    return sink, rendered
