"""The renderer of one scene: static picture, vehicles at any times, and which tiles they change."""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph_sehn.simulation.imaging.appearance import appearance_of
from jeat_graph_sehn.simulation.imaging.background import Background, make_background
from jeat_graph_sehn.simulation.imaging.config import RenderConfig
from jeat_graph_sehn.simulation.imaging.insects import draw_insects
from jeat_graph_sehn.simulation.imaging.lighting import lights_of
from jeat_graph_sehn.simulation.imaging.moments import LEFT_ON, PULSE, Look, Moments, line_up
from jeat_graph_sehn.simulation.imaging.optics import optics_of
from jeat_graph_sehn.simulation.imaging.painter import light_tile, paint_tile, take_ground
from jeat_graph_sehn.simulation.imaging.plan import MAX_STEPS, Pace, Plan, make_plan, who_touches
from jeat_graph_sehn.simulation.imaging.projection import project_moments
from jeat_graph_sehn.simulation.imaging.stage import Setting, Stage, make_setting
from jeat_graph_sehn.simulation.imaging.streaks import reach_streaks
from jeat_graph_sehn.simulation.imaging.tiles import TILE_W, tile_raster, view_of
from jeat_graph_sehn.simulation.streams import stream
from jeat_graph_sehn.simulation.world.scene import Scene, VehicleStates
from jeat_graph_sehn.simulation.world.signals import blink

_NEAR_M = -25.0
_BLINK_STEPS = 8.0  # of an interval in which an indicator may go on or off
_PULSE_STEPS = 8.0  # of a period of pulsed or flickering light
_PHASE = 0.7548776662  # from one vehicle's lamps to the next's, in periods


class Renderer:
    """Renders one scene.

    Attributes:
        scene: what is rendered.
        config: how.
        background: the static picture.
        tiles: (T, 2) first row and column of each tile.
    """

    def __init__(
        self,
        scene: Scene,
        config: RenderConfig,
        seed: int,
        varied: bool = False,
        like: Renderer | None = None,
    ) -> None:
        """Render the static picture, and give each vehicle its looks.

        Args:
            scene: what to render.
            config: how.
            seed: of the looks.
            varied: looks of their own, instead of one a kind.
            like: of the same place with other traffic; its static picture is this one's, too.
        """
        self.scene = scene
        self.config = config
        self.lights = lights_of(scene, config)
        self.optics = optics_of(scene.camera, config)
        self.view = view_of(scene.camera)
        self._settings: dict[int, Setting] = {}
        if like is None:
            self.background: Background = make_background(scene, self.lights, self.optics, config)
        else:
            self.background, self._settings = like.background, like._settings
        self.tiles = tile_raster(scene.camera.width, scene.camera.height)
        self._insects = draw_insects(stream(seed, "insects"), config.insects_hz, self.view, self.lights)
        self._varied = varied
        self._appearance = appearance_of(scene, stream(seed, "paint"), varied)

    @property
    def quick(self) -> bool:
        """Whether anything comes and goes quicker than vehicles pass: insects, pulsed lamps."""
        return self.config.insects_hz > 0.0 or self.config.led_pulse_hz > 0.0

    def plan(
        self,
        start_s: float,
        end_s: float,
        duration_s: float | None = None,
        step_px: float | None = None,
        for_events: bool = False,
    ) -> Plan:
        """Plan what is to be rendered from `start_s` to `end_s`.

        Args:
            start_s: s.
            end_s: s.
            duration_s: time in which the steps are taken, if not all of it (s).
            step_px: how far an edge may move in a step, if not as configured (px).
            for_events: lamps that blink or pulse ask for steps, too.
        """
        times = np.array([start_s, 0.5 * (start_s + end_s), end_s])
        states = self.scene.states_at(times, self.config.far_m, _NEAR_M)
        look, row = self._look(states)
        one = np.ones(len(row), dtype=np.int64)
        moments = self._project(states, times, look, one)
        velocity = np.zeros((len(row), 2))
        column = np.searchsorted(look.number, states.object_id)
        sin, cos = np.sin(states.pose[:, 2]), np.cos(states.pose[:, 2])
        vx, vy = states.velocity[:, 0], states.velocity[:, 1]
        way = np.stack([np.abs(vx * cos - vy * sin), np.abs(vx * sin + vy * cos)], axis=1)
        np.maximum.at(velocity, column, way)
        duration = end_s - start_s if duration_s is None else duration_s
        step = self.config.max_step_px if step_px is None else step_px
        least = np.ones(len(look.number))
        if for_events:
            least[self._flashes(times, look).any(axis=(0, 2))] = _BLINK_STEPS
            if self.config.led_pulse_hz > 0.0:
                least[look.led] = steps_for(self.config.led_pulse_hz, duration)
        motion = np.column_stack([velocity, least])
        insects, pace = self._insects.during(start_s, end_s), Pace(step, duration)
        return make_plan(moments, motion, look, insects, self.tiles, self.view, pace, self.lights.on)

    def seen_at(self, time_s: float) -> tuple[Look, Moments]:
        """Say which vehicles there are at a time (s), what they look like, and where they are seen."""
        times = np.array([time_s])
        states = self.scene.states_at(times, self.config.far_m, _NEAR_M)
        look, _ = self._look(states)
        return look, self._project(states, times, look, np.ones(len(look.number), dtype=np.int64))

    def moments(
        self, times: FloatArray, look: Look, every: IntArray | None = None, for_events: bool = False
    ) -> Moments:
        """Project the vehicles of a plan at `times` (J,) (s), each as often as `every` (V,) says.

        LED lamps are pulsed `for_events` alone: exposures see their mean.
        """
        states = self.scene.states_at(times, self.config.far_m, _NEAR_M)
        stride = np.ones(len(look.number), dtype=np.int64) if every is None else every
        return self._project(states, times, look, stride, for_events)

    def stage(self, moments: Moments, plan: Plan, channels: int = 3) -> Stage:
        """Put together what tiles of a plan are painted from, in three channels or in luminance alone (1)."""
        if channels not in self._settings:
            self._settings[channels] = make_setting(
                self.background, self.lights, self.optics, self.view, channels, self.config.wet
            )
        insects = plan.insects.at(moments.times, self.view)
        return self._settings[channels].stage(moments, plan.look, insects)

    def picture(self, time_s: float) -> FloatArray:
        """Render the whole picture at one time: radiance (H, W, 3) in cd/m²."""
        plan = self.plan(time_s, time_s)
        out = self.background.whole.copy()
        stage = self.stage(self.moments(np.array([time_s]), plan.look), plan)
        paint_all(out, self.tiles, plan.boxes, stage)
        return out

    def _look(self, states: VehicleStates) -> tuple[Look, IntArray]:
        number, first = np.unique(states.object_id, return_index=True)
        looks = self._appearance
        which = (number - 1) % len(looks.colour)
        parked, lit = states.parked[first], looks.lit[which]
        look = Look(
            kind=states.kind[first],
            size=states.size[first],
            colour=looks.colour[which],
            salt=100 + number,
            way=states.direction[first],
            parked=parked,
            number=number,
            shape=looks.shape[which],
            lamps=looks.lamps[which] * lit[:, None, None],
            beams=~parked & lit,
            blink_hz=looks.blink_hz[which],
            hazard=looks.hazard[which],
            led=looks.led[which],
        )
        return look, first.astype(np.int64)

    def _flashes(self, times: FloatArray, look: Look) -> BoolArray:
        """Which vehicles use their left and right indicators at times (T,): (T, V, 2)."""
        if not self._varied:
            return np.zeros((len(times), len(look.number), 2), dtype=np.bool_)
        return self.scene.turning_at(times, look.number) | (look.hazard & look.parked)[:, None]

    def _project(
        self, states: VehicleStates, times: FloatArray, look: Look, every: IntArray, for_events: bool = False
    ) -> Moments:
        placed = line_up(states, look.number, times, self.config.far_m)
        if self._varied:
            bright = blink(times, look.blink_hz, _PHASE * look.salt.astype(np.float64))
            placed.signal[..., LEFT_ON : LEFT_ON + 2] = self._flashes(times, look) * bright[..., None]
        if for_events and self.config.led_pulse_hz > 0.0:
            share = self.config.led_pulse_share
            on = (times[:, None] * self.config.led_pulse_hz + look.salt * _PHASE) % 1.0 < share
            placed.signal[..., PULSE] = np.where(look.led, on / share, 1.0)
        moments = project_moments(placed, look, every, self.view, self.lights, self.optics)
        if self.config.wet > 0.0 and self.lights.on:
            reach_streaks(moments, float(self.view.lens[1]))
        return moments


def steps_for(rate_hz: float, duration_s: float) -> int:
    """Steps, a power of two, that show light of a rate (Hz) go on and off for `duration_s`."""
    steps = 1
    while steps < _PULSE_STEPS * rate_hz * duration_s and steps < MAX_STEPS:
        steps *= 2
    return steps


@njit(cache=True, error_model="numpy")
def paint_all(out: FloatArray, tiles: IntArray, boxes: FloatArray, stage: Stage) -> None:
    """Paint the tiles that vehicles touch, at the first of the moments, into a picture (H, W, C)."""
    who = np.zeros((3, max(1, len(boxes))), dtype=np.int64)
    counts = np.zeros(3, dtype=np.int64)
    canvas = stage.canvas
    for n in range(len(tiles)):
        row0, column0 = tiles[n]
        if who_touches(row0, column0, boxes, who, counts) == 0:
            continue
        tile = take_ground(row0, column0, stage.packed, canvas.ground)
        light_tile(tile, 0, who, counts, stage, canvas.light)
        paint_tile(tile, 0, who, counts, stage, canvas.light)
        for r in range(tile.rows):
            for c in range(tile.columns):
                out[row0 + r, column0 + c] = canvas.out[r * TILE_W + c]
