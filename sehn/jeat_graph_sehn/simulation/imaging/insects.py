"""Insects that cross the view near the lens: blurred streaks in pictures, bursts of events, no truth.

They come at random, cross the view in a slightly wavy line, and are dark against the sky by day, lit by
street lamps at night. The rate is that of insects large and near enough to be seen, a few a minute in summer.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.imaging.background import GAIN
from jeat_graph_sehn.simulation.imaging.layers import TileLayers, meets
from jeat_graph_sehn.simulation.imaging.lighting import Lights, Surface, lamp_lux, luminance
from jeat_graph_sehn.simulation.imaging.smooth import clamp01
from jeat_graph_sehn.simulation.imaging.tiles import TILE_W, Tile, View

HORIZON_S = 600.0  # for how long they are drawn; segments are shorter
_NEAR_S = 8.0  # before and after the middle of its way an insect is in sight for less
_DISTANCE_M = (0.25, 1.5)
_SPEED_M_S = (0.5, 4.0)  # flies and moths to bees
_RADIUS_M = (0.0015, 0.005)  # of the body, wings not counted
_WAVE_M, _WAVE_HZ = 0.02, (2.0, 8.0)
_ALBEDO = 0.15
_APERTURE_M = 0.0015  # of the lens, which is focused on the road: f/2 at 3 mm
_LEAST_SOFT_PX = 0.5
_PATH_TIMES = 17  # at which an interval's path is looked at for where it goes
_SPARE_PX = 3.0
# Of an insect at a time: place (px), radius and half the width of its rim (px), colour (cd/m²).
U, V, RADIUS, SOFT, COLOUR, RECORD = 0, 1, 2, 3, 4, 7


class Insects(NamedTuple):
    """I insects of a segment, in the camera's axes (m).

    Attributes:
        middle: (I,) when each is in the middle of its way (s).
        place: (I, 3) where it is then.
        velocity: (I, 3) m/s.
        wave: (I, 3) amplitude of its wavy way, across it.
        turn: (I, 2) frequency (1/s, as 2 π f) and phase of that.
        radius: (I,) of its body.
        colour: (3,) its luminance in three channels (cd/m²).
    """

    middle: FloatArray
    place: FloatArray
    velocity: FloatArray
    wave: FloatArray
    turn: FloatArray
    radius: FloatArray
    colour: FloatArray

    def during(self, start_s: float, end_s: float) -> Insects:
        """Those that may be in sight at some time from `start_s` to `end_s`."""
        there = (self.middle > start_s - _NEAR_S) & (self.middle < end_s + _NEAR_S)
        return Insects._make((*(column[there] for column in self[:-1]), self.colour))

    def at(self, times: FloatArray, view: View) -> FloatArray:
        """Place the insects in the picture at times (J,) (s): (J, I, RECORD), radius 0 behind the lens."""
        since = times[:, None] - self.middle
        wave = np.sin(self.turn[:, 0] * since + self.turn[:, 1])
        place = self.place + since[..., None] * self.velocity + wave[..., None] * self.wave
        depth = np.maximum(place[..., 2], 0.5 * _DISTANCE_M[0])
        out = np.zeros((len(times), len(self.middle), RECORD))
        out[..., U] = view.lens[0] * place[..., 0] / depth + view.lens[2]
        out[..., V] = view.lens[1] * place[..., 1] / depth + view.lens[3]
        out[..., RADIUS] = np.where(place[..., 2] > 0.0, view.lens[0] * self.radius / depth, 0.0)
        out[..., SOFT] = np.maximum(0.5 * view.lens[0] * _APERTURE_M / depth, _LEAST_SOFT_PX)
        out[..., COLOUR:] = self.colour
        return out

    def path(self, start_s: float, end_s: float, view: View) -> tuple[FloatArray, FloatArray]:
        """Boxes (I, 4) left, top, right, bottom (px) of where they go meanwhile, and their speeds (px/s)."""
        times = np.linspace(start_s, end_s, _PATH_TIMES)
        records = self.at(times, view)
        place = records[..., : V + 1]
        reach = (records[..., RADIUS] + records[..., SOFT] + _SPARE_PX)[..., None]
        steps = np.linalg.norm(np.diff(place, axis=0), axis=-1).max(axis=0, initial=0.0)
        speed = steps * (_PATH_TIMES - 1) / max(end_s - start_s, 1e-9)
        low, high = (place - reach).min(axis=0), (place + reach).max(axis=0)
        return np.concatenate([low, high], axis=1), speed


def draw_insects(rng: np.random.Generator, rate_hz: float, view: View, lights: Lights) -> Insects:
    """Draw the insects of a segment.

    Args:
        rng: of the segment's insects.
        rate_hz: how many cross the view a second, on average.
        view: the camera.
        lights: of the scene.
    """
    middle = np.sort(rng.uniform(0.0, HORIZON_S, rng.poisson(rate_hz * HORIZON_S)))
    count = len(middle)
    depth = _spread(rng, _DISTANCE_M, count)
    within = rng.uniform(0.1, 0.9, (count, 2)) * view.lens[4:6] - view.lens[2:4]
    place = np.column_stack([within / view.lens[:2] * depth[:, None], depth])
    heading = rng.uniform(0.0, 2.0 * math.pi, count)
    speed = _spread(rng, _SPEED_M_S, count)
    # Mostly across the view: what flies towards the lens does so for longer than it is near it.
    velocity = speed[:, None] * np.column_stack(
        [np.cos(heading), 0.5 * np.sin(heading), 0.1 * np.sin(heading)]
    )
    across = np.column_stack([-np.sin(heading), np.cos(heading), np.zeros(count)])
    turn = np.column_stack(
        [2.0 * math.pi * rng.uniform(*_WAVE_HZ, count), rng.uniform(0.0, 2.0 * math.pi, count)]
    )
    return Insects(
        middle=middle,
        place=place,
        velocity=velocity,
        wave=_WAVE_M * rng.uniform(0.0, 1.0, (count, 1)) * across,
        turn=turn,
        radius=_spread(rng, _RADIUS_M, count),
        colour=_colour(view, lights),
    )


def _spread(rng: np.random.Generator, limits: tuple[float, float], count: int) -> FloatArray:
    """Draw numbers whose logarithm is even between limits (count,)."""
    return np.exp(rng.uniform(math.log(limits[0]), math.log(limits[1]), count))


def _colour(view: View, lights: Lights) -> FloatArray:
    """Luminance in three channels of an insect at the lens, by light from ahead, behind and above."""
    x, y, z = (float(v) for v in view.eye)
    nx, ny, nz = (float(v) for v in view.rotation[2])
    faces = Surface(x, y, z, nx, ny, nz), Surface(x, y, z, -nx, -ny, -nz), Surface(x, y, z, 0.0, 0.0, 1.0)
    lamps = 0.5 * sum(lamp_lux(face, lights) for face in faces)
    light = 0.5 * lights.sky_lux * lights.sky_tint + 0.25 * lights.sun_lux * lights.sun_tint
    out: FloatArray = _ALBEDO / math.pi * (light + lamps * lights.lamp_tint)
    return out


@njit(cache=True, error_model="numpy", inline="always")
def insect_meets(insect: FloatArray, row0: int, column0: int) -> bool:
    """Say whether an insect (RECORD,) is on the tile that begins at (row0, column0)."""
    reach = insect[RADIUS] + insect[SOFT]
    u, v = insect[U], insect[V]
    return insect[RADIUS] > 0.0 and meets(u - reach, v - reach, u + reach, v + reach, row0, column0)


@njit(cache=True, error_model="numpy")
def add_insect(tile: Tile, insect: FloatArray, canvas: TileLayers) -> None:
    """Lay an insect (RECORD,) over what was painted: nearer than all else, out of focus."""
    out = canvas.out
    u, v, radius, soft = insect[U], insect[V], insect[RADIUS], insect[SOFT]
    # A disc smaller than its blur is as much fainter.
    most = min(1.0, (radius / soft) ** 2)
    for r in range(tile.rows):
        for c in range(tile.columns):
            p = r * TILE_W + c
            away = math.sqrt((tile.column + c + 0.5 - u) ** 2 + (tile.row + r + 0.5 - v) ** 2)
            cover = most * clamp01(0.5 + 0.5 * (radius - away) / soft)
            if cover <= 0.0:
                continue
            gain = canvas.ground[p, GAIN]
            if out.shape[1] == 1:
                level = luminance(insect[COLOUR], insect[COLOUR + 1], insect[COLOUR + 2])
                out[p, 0] += cover * (gain * level - out[p, 0])
            else:
                for k in range(3):
                    out[p, k] += cover * (gain * insect[COLOUR + k] - out[p, k])
