"""The event camera over a scene: which tiles are rendered how often, and the events of all pixels."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.events import EventArray
from jeat_graph_sehn.simulation.imaging.carla_pixel import (
    CarlaModel,
    CarlaState,
    carla_advance,
    make_carla_model,
    make_carla_state,
)
from jeat_graph_sehn.simulation.imaging.config import ImagingConfig
from jeat_graph_sehn.simulation.imaging.event_pixel import make_model, make_state
from jeat_graph_sehn.simulation.imaging.event_run import (
    Interval,
    coarse_steps,
    fill,
    light_all,
    read_luminance,
    run_physical,
)
from jeat_graph_sehn.simulation.imaging.event_sink import (
    EventSink,
    SinkColumns,
    make_sink,
    to_events,
    with_room,
)
from jeat_graph_sehn.simulation.imaging.lamp_flicker import LampFlicker
from jeat_graph_sehn.simulation.imaging.layers import GLOW
from jeat_graph_sehn.simulation.imaging.lighting import LUMINANCE
from jeat_graph_sehn.simulation.imaging.painter import light_tile, paint_tile, take_ground
from jeat_graph_sehn.simulation.imaging.plan import Plan, who_touches
from jeat_graph_sehn.simulation.imaging.renderer import Renderer
from jeat_graph_sehn.simulation.imaging.stage import Stage
from jeat_graph_sehn.simulation.imaging.tiles import TILE
from jeat_graph_sehn.simulation.streams import stream

_LARGEST_CHANGE = 45.0  # ln of the largest ratio of luminances, with room to spare


class EventCamera:
    """Makes the events of one scene, interval by interval.

    Attributes:
        rendered: tiles rendered so far.
    """

    def __init__(
        self, renderer: Renderer, config: ImagingConfig, seed: int, segment_seed: int, scale: float
    ) -> None:
        """Start at time 0, with pixels that have settled at what they see then.

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
        self._glowing = np.zeros(len(renderer.tiles), dtype=np.bool_)
        self._light = np.zeros((len(renderer.tiles), TILE, GLOW + 1))
        self._lamps = LampFlicker(renderer, not self._carla)
        self._begin()
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
        plan = self.renderer.plan(1e-6 * self._now_us, 1e-6 * until_us, for_events=True)
        flickers = self._lamps.steps(1e-6 * (until_us - self._now_us))
        if flickers > plan.most:
            plan = plan._replace(most=flickers, every=plan.every * (flickers // plan.most))
        share = np.arange(plan.most + 1, dtype=np.float64) / plan.most
        times_us = self._now_us + (until_us - self._now_us) * share
        self._now_us = until_us
        return self._run(plan, times_us)

    def _begin(self) -> None:
        """Take the light of beams and glow that there is at the beginning."""
        r = self.renderer
        plan = r.plan(0.0, 0.0)
        stage = r.stage(r.moments(np.zeros(1), plan.look), plan, channels=1)
        light_all(r.tiles, plan.boxes, plan.lit, stage, self._glowing, self._light)

    def _run(self, plan: Plan, times_us: FloatArray) -> EventArray:
        r = self.renderer
        every = None if self._carla else plan.every
        moments = r.moments(1e-6 * times_us[1:], plan.look, every, for_events=True)
        steps = np.where(plan.steps > 0, len(times_us) - 1, 0) if self._carla else plan.steps
        run = _run_carla if self._carla else run_physical
        work = Interval(
            *(r.tiles, plan.boxes, steps, plan.lit, times_us, self._static),
            *(
                self._quiet,
                self._glowing,
                self._light,
                self._lamps.within(1e-6 * times_us),
                coarse_steps(r.quick),
            ),
        )
        sink = make_sink(max(1 << 18, 2 * self._room))
        stage = r.stage(moments, plan, channels=1)
        made = run(work, stage, self._model, self._state, sink, self._room)
        self.rendered += made[-1]
        return to_events(EventSink(*made[:-1]), self._width)


@njit(cache=True, error_model="numpy")
def _run_carla(
    work: Interval, stage: Stage, model: CarlaModel, state: CarlaState, sink: EventSink, room: int
) -> SinkColumns:
    """Take all pixels from tick to tick, tile by tile; as `run_physical`."""
    tiles, boxes, steps, lit, times_us, static, _, _, _, _, _ = work
    who = np.zeros((3, max(1, len(boxes))), dtype=np.int64)
    counts = np.zeros(3, dtype=np.int64)
    pixels, luminance = np.zeros(TILE, dtype=np.int64), np.zeros(TILE)
    canvas = stage.canvas
    rendered = 0
    for n in range(len(tiles)):
        row0, column0 = tiles[n]
        count = fill(row0, column0, static, pixels, luminance)
        who_touches(row0, column0, boxes, who, counts)
        tile = take_ground(row0, column0, stage.packed, canvas.ground)
        for j in range(len(times_us) - 1):
            sink = with_room(sink, room)
            if steps[n] > 0 or lit[n] > 0:
                light_tile(tile, j, who, counts, stage, canvas.light)
                paint_tile(tile, j, who, counts, stage, canvas.light)
                read_luminance(canvas.out, tile, luminance)
                rendered += 1
            carla_advance(pixels[:count], luminance[:count], times_us[j], times_us[j + 1], model, state, sink)
    return sink.used, sink.t_us, sink.pixel, sink.polarity, sink.by_motion, rendered
