"""A wet road: darker, and a mirror at low angles for what stands behind it and for street lamps.

A film of water reflects by Fresnel's law; where the surface is coarse the film is broken, and the slopes of
its facets blur what is mirrored, downwards most of all. Bodies of vehicles are not mirrored, only their lamps
(see `streaks`).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.imaging.landscape import Landscape
from jeat_graph_sehn.simulation.imaging.lighting import Lights
from jeat_graph_sehn.simulation.imaging.rays import road_place
from jeat_graph_sehn.simulation.imaging.smooth import clamp01, value_noise
from jeat_graph_sehn.simulation.imaging.tiles import View
from jeat_graph_sehn.simulation.imaging.trace import LEAVES, SKY, behind, in_front
from jeat_graph_sehn.simulation.world.camera import Camera

COARSE = 0.55  # share of the film's mirror that asphalt leaves whole
STREAK = 0.5  # length of a lamp's streak over the distance of lamp and mirror image, std
WIDER = 1.5  # a streak's width over the lamp's image
_DARKER = 0.4  # share of the albedo that a film of water takes
_WATER = 0.02  # reflectance of water at normal incidence
_SLOPE = 0.05  # of the facets, rms
_FACETS_M = 25.0  # distance from which single facets are no longer distinguished
_DOWNWARDS = 0.1  # share of a street lamp's intensity that it sends at low angles to a wet road


@njit(cache=True, error_model="numpy")
def fresnel(cosine: float) -> float:
    """Reflectance of water at an angle of incidence (Schlick 1994)."""
    return _WATER + (1.0 - _WATER) * (1.0 - min(max(cosine, 0.0), 1.0)) ** 5


@njit(cache=True, error_model="numpy")
def film(x: float, y: float, wet: float, salt: int) -> float:
    """How whole the film of water is at a place (m), 0 to 1: puddles where the road is worn."""
    patch = 0.6 * value_noise(0.35 * x, 0.06 * y, salt + 21) + 0.4 * value_noise(2.0 * x, 0.7 * y, salt + 22)
    return clamp01(wet * (0.85 + 0.5 * patch))


@njit(cache=True, error_model="numpy")
def mirror_ground(
    view: View, land: Landscape, lights: Lights, wet: float, place: FloatArray, back: FloatArray,
    albedo: FloatArray,
) -> None:  # fmt: skip
    """Make the pavement of a static picture wet: `back` and `albedo` (H, W, 3) are changed."""
    rotation, lens = view.rotation, view.lens
    height, width = back.shape[:2]
    sky = (lights.sky_lux + 0.25 * lights.sun_lux) / math.pi
    what, from_road = np.zeros(6), np.zeros(3)
    layout = land.layout
    for row in range(height):
        for column in range(width):
            if albedo[row, column, 0] <= 0.0:
                continue
            x, y = place[row, column, 0], place[row, column, 1]
            across, along = road_place(x, y, land.curvature)
            if abs(across) > layout.paved or abs(across) < layout.inner - 0.6:
                continue
            whole = film(across, along, wet, layout.salt)
            X, Y = (column + 0.5 - lens[2]) / lens[0], (row + 0.5 - lens[3]) / lens[1]
            dx = X * rotation[0, 0] + Y * rotation[1, 0] + rotation[2, 0]
            dy = X * rotation[0, 1] + Y * rotation[1, 1] + rotation[2, 1]
            dz = X * rotation[0, 2] + Y * rotation[1, 2] + rotation[2, 2]
            size = math.sqrt(dx * dx + dy * dy + dz * dz)
            share = whole * COARSE * fresnel(-dz / size)
            # Far away a pixel holds many facets, whose mean is the road's own slope.
            slope = _SLOPE * math.exp(-math.hypot(x - view.eye[0], y - view.eye[1]) / _FACETS_M)
            up = -dz + 2.0 * slope * size * value_noise(14.0 * across, 5.0 * along, layout.salt + 23)
            up = max(up, 0.002 * size)
            from_road[0], from_road[1], from_road[2] = x, y, 0.01
            near = in_front(from_road, dx, dy, up, land, lights, what)
            kind, far = behind(from_road, dx, dy, up, land)
            for c in range(3):
                if near < far:
                    seen = what[c] * 0.6 * (lights.sky_lux + lights.sun_lux) * lights.sky_tint[c] / math.pi
                elif kind == SKY:
                    seen = sky * (1.0 - 0.5 * up / size) * lights.sky_tint[c]
                elif kind == LEAVES:
                    seen = land.country.leaves[c] * 0.5 * (lights.sky_lux + lights.sun_lux) / math.pi
                else:
                    seen = 0.3 * sky * lights.sky_tint[c]
                back[row, column, c] = back[row, column, c] * (1.0 - _DARKER * whole) + share * seen
                albedo[row, column, c] *= 1.0 - _DARKER * whole


def mirror_lamps(camera: Camera, lights: Lights, wet: float, lux: FloatArray, back: FloatArray) -> None:
    """Add the street lamps' streaks to the ground of a static picture (H, W, 3)."""
    if not len(lights.lamps):
        return
    image, depth = camera.project(lights.lamps * np.array([1.0, 1.0, -1.0]))
    foot, _ = camera.project(lights.lamps * np.array([1.0, 1.0, 0.0]))
    v, u = np.mgrid[0 : camera.height, 0 : camera.width] + 0.5
    for at, low, z, lamp in zip(image, foot, depth, lights.lamps, strict=True):
        if z < 3.0:
            continue
        distance = float(np.linalg.norm(lamp - camera.position))
        cosine = float(lamp[2] + camera.position[2]) / distance
        wide = math.hypot(WIDER * 0.3 * camera.fx / z, 0.7)
        long = 0.5 * STREAK * abs(float(at[1] - low[1])) + wide
        flux = (
            _DOWNWARDS
            * lights.lamp_candela
            / distance**2
            * camera.fx
            * camera.fy
            * math.exp(-lights.beta * z)
        )
        flux *= wet * COARSE * fresnel(cosine) / (2.0 * math.pi * wide * long)
        streak = flux * np.exp(-0.5 * ((u - at[0]) / wide) ** 2 - 0.5 * ((v - at[1]) / long) ** 2)
        back += np.where(lux > 0.0, streak, 0.0)[..., None] * lights.lamp_tint
